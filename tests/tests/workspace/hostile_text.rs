//! Text from a specification never becomes code: whatever stands in titles, descriptions and names, the generated
//! module and header have the items and expressions that harmless text gives, or the specification is refused with a
//! message.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::{Code, HOSTS, items};
use mmsmith_spec::Spec;
use mmsmith_tests::{c_compiler, cpp_compiler, outcome};
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::ffi::OsStr;
use std::fmt::Write as _;

/// Text that ends a literal or a comment, starts code, or hides in what a reader sees.
fn hostile() -> Vec<String> {
    let mut texts: Vec<String> = [
        "\"; panic!(); \"",
        "\"#; panic!(); r#\"",
        "\" }] } fn owned() { panic!() } //",
        "*/ fn owned() {} /*",
        "/* /* /*",
        "// fn owned() {}",
        "\n//! owned\nfn owned() {}\n",
        "\r\nfn owned() {}\r",
        "\u{2028}fn owned() {}\u{2029}\u{85}\u{b}\u{c}",
        "#[doc = \"x\"] struct Owned;",
        "#![allow(everything)]",
        "{} {0} {owned} {{ }} }} {{",
        "macro_rules! owned { () => {} } owned!();",
        "include_str!(\"/etc/passwd\")",
        "\\",
        "\\\\\"",
        "\\n\\u{0}\\x00\\",
        "'a' '\\'' b'\\''",
        "```\nfn owned() {}\n```",
        "[`Owned`](https://example.org) <script>",
        "\0\u{1}\u{7f}\u{1b}[31m",
        "??/ ??> %:include <: :>",
        "*??/\n/ int owned; /*",
        "*\\\n/ int owned; /*",
        "/\\\n* /??/\n* *\\",
        "\n#define double int\n#include \"/etc/passwd\"\n",
        "//\\",
        "%s%n%hn",
        "\nlet statements_of_block = 0;\n",
        "caf\u{e9} \u{1d54f} \u{1f9ea} e\u{301}",
    ]
    .map(str::to_owned)
    .to_vec();
    texts.push("x".repeat(100_000));
    texts.push("\"\\".repeat(50_000));
    texts.push(" /* ".repeat(25_000));
    texts
}

/// Invisible characters that show code in another order than the compiler reads it.
const DIRECTIONS: [char; 12] = [
    '\u{61c}', '\u{200e}', '\u{200f}', '\u{202a}', '\u{202b}', '\u{202c}', '\u{202d}', '\u{202e}',
    '\u{2066}', '\u{2067}', '\u{2068}', '\u{2069}',
];

/// A TOML string with every character that needs it escaped.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => write!(quoted, "\\{c}").unwrap(),
            ' '..='~' => quoted.push(c),
            _ => write!(quoted, "\\U{:08X}", c as u32).unwrap(),
        }
    }
    quoted + "\""
}

/// A specification with `text` wherever a specification has free text, and a parameter called `name`.
fn specification(text: &str, name: &str) -> String {
    let text = quoted(text);
    let name = quoted(name);
    format!(
        "name = 'hostile'\ntitle = {text}\nreference = {text}\ncoordinates = 'cartesian'\ndimension = 2\n\
         require = ['A < E']\n\
         [parameters]\n\
         A = {{ default = 0.1, range = '> -1, < 1', unit = {text}, description = {text} }}\n\
         E = {{ default = 10, description = {text} }}\n\
         {name} = {{ default = 0.3, unit = {text} }}\n\
         [displacement]\nX = 'A*sin(Y)*t'\n\
         [material]\nlaw = 'neo-hookean'\nlambda = 'E'\nmu = 'E'\ndensity = 1\n\
         [domain]\nshape = 'box'\nlower = [0, 0]\nupper = [1, 1]\n\
         [time]\nperiod = 1\n"
    )
}

/// The tokens without documentation, and with every string literal empty.
fn skeleton(tokens: TokenStream) -> Vec<String> {
    let mut parts = Vec::new();
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        match token {
            TokenTree::Punct(hash) if hash.as_char() == '#' => {
                if matches!(tokens.peek(), Some(TokenTree::Punct(p)) if p.as_char() == '!') {
                    tokens.next();
                }
                let documentation = match tokens.peek() {
                    Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Bracket => {
                        matches!(&group.stream().into_iter().collect::<Vec<_>>()[..],
                            [TokenTree::Ident(doc), TokenTree::Punct(_), TokenTree::Literal(_)] if doc == "doc")
                    }
                    _ => false,
                };
                if documentation {
                    tokens.next();
                } else {
                    parts.push("#".into());
                }
            }
            TokenTree::Group(group) => {
                parts.push(format!("{:?}", group.delimiter()));
                parts.extend(skeleton(group.stream()));
                parts.push("end".into());
            }
            TokenTree::Literal(literal) => {
                let text = literal.to_string();
                let is_text = text.contains('"');
                parts.push(if is_text { "\"\"".into() } else { text });
            }
            TokenTree::Ident(ident) => parts.push(ident.to_string()),
            TokenTree::Punct(punct) => parts.push(punct.as_char().to_string()),
        }
    }
    // Before a closing delimiter a comma may stand or not: the line's length decides.
    let mut kept: Vec<String> = Vec::new();
    for part in parts {
        if part == "end" && kept.last().is_some_and(|last| last == ",") {
            kept.pop();
        }
        kept.push(part);
    }
    kept
}

/// The text of a C header without comments, and with every string literal empty.
///
/// The compiler first joins lines that end with a backslash, or with the trigraph for one; there must be none of either.
fn c_skeleton(header: &str) -> String {
    for sign in ["\\\n", "??", "\r"] {
        assert!(!header.contains(sign), "{sign:?}");
    }
    assert!(header.is_ascii() || header.chars().all(|c| c.is_ascii() || c.is_alphanumeric()));
    let mut skeleton = String::new();
    let mut rest = header;
    while let Some(place) = rest.find(['/', '"', '\'']) {
        skeleton += &rest[..place];
        rest = &rest[place..];
        if let Some(comment) = rest.strip_prefix("/*") {
            let (comment, code) = comment.split_once("*/").expect("the comment ends");
            assert!(!comment.contains("/*"), "{comment}");
            rest = code;
        } else if let Some(text) = rest.strip_prefix('"') {
            let mut escaped = false;
            let end = text.find(|c| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                assert!(c != '\n', "{text}");
                ends
            });
            skeleton += "\"\"";
            rest = &text[end.expect("the literal ends") + 1..];
        } else {
            assert!(!rest.starts_with("//") && !rest.starts_with('\''), "{rest}");
            skeleton += "/";
            rest = &rest[1..];
        }
    }
    skeleton += rest;
    // Comments of several lines leave none or some of white space.
    skeleton.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn header(spec: &Spec) -> String {
    let source = Code::new(spec).unwrap().header_source();
    for c in source.chars() {
        assert!(c == '\n' || !c.is_control(), "{c:?} in {}", spec.name);
        assert!(!DIRECTIONS.contains(&c), "{c:?} in {}", spec.name);
    }
    source
}

/// Compiles headers, as C and where possible as C++, after other headers that define many names.
fn compile(headers: &[(String, String)]) {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from(
        "#define _GNU_SOURCE 1\n#include <math.h>\n#ifndef __cplusplus\n#include <complex.h>\n#include <stdbool.h>\n\
         #include <tgmath.h>\n#endif\n#include <errno.h>\n#include <float.h>\n#include <limits.h>\n\
         #include <stdint.h>\n#include <stdio.h>\n#include <stdlib.h>\n",
    );
    for (name, header) in headers {
        std::fs::write(folder.path().join(name), header).unwrap();
        writeln!(text, "#include \"{name}\"").unwrap();
    }
    let source = folder.path().join("all.c");
    std::fs::write(&source, text).unwrap();
    let object = folder.path().join("all.o");
    let strict: Vec<&OsStr> = ["-pedantic", "-Wall", "-Wextra", "-Werror", "-c", "-o"]
        .into_iter()
        .map(OsStr::new)
        .chain([object.as_os_str()])
        .collect();
    let (status, _, errors) = outcome(c_compiler().arg("-std=c99").args(&strict).arg(&source));
    assert_eq!(status, Some(0), "{errors}");
    if let Some(mut compiler) = cpp_compiler() {
        let command = compiler.args(["-x", "c++", "-std=c++17"]).args(&strict).arg(&source);
        let (status, _, errors) = outcome(command);
        assert_eq!(status, Some(0), "{errors}");
    }
}

/// A header in which the solution has another name than `hostile`, so that several can be compiled at once.
fn renamed(header: &str, name: &str) -> (String, String) {
    let text = header.replace("hostile_", &format!("{name}_")).replace("HOSTILE_H", name);
    (format!("{name}.h"), text)
}

#[test]
fn free_text_stays_text_in_c() {
    let harmless = Spec::parse(&specification("harmless", "nu"), "harmless.toml").unwrap();
    let harmless = c_skeleton(&header(&harmless));
    assert!(harmless.contains("hostile_b_array"));
    let mut headers = Vec::new();
    for (number, text) in hostile().iter().enumerate() {
        let shown: String = text.chars().take(60).collect();
        let spec = Spec::parse(&specification(text, "nu"), "hostile.toml").unwrap();
        let header = header(&spec);
        assert!(c_skeleton(&header) == harmless, "{shown:?} changes the code");
        headers.push(renamed(&header, &format!("text{number}")));
    }
    compile(&headers);
}

/// Syntax of text in the files of a host.
struct Syntax {
    host: &'static str,
    /// How comments begin and end.
    comments: &'static [[&'static str; 2]],
    strings: Strings,
}

/// How a quotation mark is written within quotation marks.
#[derive(PartialEq)]
enum Strings {
    /// After a backslash.
    Escaped,
    /// Twice; pieces of one string are joined by `// &`.
    Doubled,
    /// There are no strings of free text.
    None,
}

const LINE: [&str; 2] = ["//", "\n"];
const BLOCK: [&str; 2] = ["/*", "*/"];
const HASH: [&str; 2] = ["#", "\n"];
const EXCLAMATION: [&str; 2] = ["!", "\n"];

/// All hosts but Rust, whose tokens are compared.
const SYNTAX: &[Syntax] = &[
    Syntax { host: "c", comments: &[BLOCK], strings: Strings::Escaped },
    Syntax { host: "cpp", comments: &[LINE, BLOCK], strings: Strings::Escaped },
    Syntax { host: "fortran", comments: &[EXCLAMATION], strings: Strings::Doubled },
    Syntax { host: "abaqus", comments: &[EXCLAMATION], strings: Strings::Doubled },
    Syntax { host: "calculix", comments: &[EXCLAMATION], strings: Strings::Doubled },
    Syntax { host: "numpy", comments: &[HASH], strings: Strings::Escaped },
    Syntax { host: "jax", comments: &[HASH], strings: Strings::Escaped },
    Syntax { host: "ufl", comments: &[HASH], strings: Strings::Escaped },
    Syntax { host: "julia", comments: &[HASH], strings: Strings::Escaped },
    Syntax { host: "moose", comments: &[HASH], strings: Strings::None },
    Syntax { host: "openfoam", comments: &[LINE], strings: Strings::Escaped },
    Syntax { host: "kratos", comments: &[], strings: Strings::Escaped },
    Syntax { host: "febio", comments: &[["<!--", "-->"]], strings: Strings::None },
];

/// The text without comments, and with every string literal empty.
fn without_text(text: &str, syntax: &Syntax) -> String {
    let mut code = String::new();
    let mut rest = text;
    while !rest.is_empty() {
        let comment = syntax.comments.iter().find(|[start, _]| rest.starts_with(start));
        if let Some([start, end]) = comment {
            let (inner, after) = rest[start.len()..].split_once(end).expect("the comment ends");
            assert!(*end != "-->" || !inner.contains("--"), "{}: {inner}", syntax.host);
            code.push('\n');
            rest = after;
        } else if rest.starts_with('"') && syntax.strings != Strings::None {
            let literal = &rest[1..];
            let mut end = 0;
            loop {
                let c = literal[end..].chars().next().expect("the literal ends");
                assert!(c != '\n', "{}: {literal:.100}", syntax.host);
                if c == '"'
                    && syntax.strings == Strings::Doubled
                    && literal[end..].starts_with("\"\"")
                {
                    end += 2;
                } else if c == '\\' && syntax.strings == Strings::Escaped {
                    end += 1 + literal[end + 1..].chars().next().map_or(0, char::len_utf8);
                } else if c == '"' {
                    break;
                } else {
                    end += c.len_utf8();
                }
            }
            code.push_str("\"\"");
            rest = &literal[end + 1..];
        } else {
            let c = rest.chars().next().expect("there is more");
            code.push(c);
            rest = &rest[c.len_utf8()..];
        }
    }
    code.split_whitespace().collect::<Vec<_>>().join(" ").replace("\"\" // & \"\"", "\"\"")
}

#[test]
fn free_text_stays_text_for_every_host() {
    let named: Vec<&str> = SYNTAX.iter().map(|syntax| syntax.host).collect();
    let missing: Vec<&str> =
        HOSTS.iter().map(|host| host.name).filter(|name| !named.contains(name)).collect();
    assert_eq!(missing, ["rust"], "no syntax for a host");
    let specs: Vec<(String, Spec)> = std::iter::once("harmless".to_owned())
        .chain(hostile())
        .chain(
            [
                "coding: utf-7",
                "-*- coding: latin-1 -*-",
                "$(run) ${HOME} #{ #} #calc",
                "-->",
                "--",
                "& <x/> ]]>",
                "!DIR$ x",
                "!$omp",
            ]
            .map(str::to_owned),
        )
        .map(|text| {
            let spec = Spec::parse(&specification(&text, "nu"), "hostile.toml").unwrap();
            (text, spec)
        })
        .collect();
    let mut codes = specs.iter().map(|(text, spec)| (text, Code::new(spec).unwrap()));
    let (_, harmless) = codes.next().unwrap();
    let host = |name: &str| HOSTS.iter().find(|host| host.name == name).unwrap();
    let harmless: Vec<String> = SYNTAX
        .iter()
        .map(|syntax| without_text(&host(syntax.host).source(&harmless).unwrap(), syntax))
        .collect();
    for (text, code) in codes {
        let shown: String = text.chars().take(60).collect();
        for (syntax, harmless) in SYNTAX.iter().zip(&harmless) {
            let source = host(syntax.host).source(&code).unwrap();
            for c in source.chars() {
                assert!(c == '\n' || !c.is_control(), "{}: {c:?}", syntax.host);
                assert!(!DIRECTIONS.contains(&c), "{}: {c:?}", syntax.host);
            }
            // Lines that are joined, and what C reads as another sign.
            assert!(!source.contains("\\\n"), "{}: {shown:?}", syntax.host);
            let of_c = matches!(syntax.host, "c" | "cpp" | "openfoam");
            assert!(!of_c || !source.contains("??"), "{}: {shown:?}", syntax.host);
            let found = without_text(&source, syntax);
            assert!(found == *harmless, "{}: {shown:?} changes the code", syntax.host);
        }
    }
}

/// Names that parameters may have, and that are no names in C or C++, or macros of their headers.
#[test]
fn names_that_are_words_of_c_give_code() {
    let words = [
        "int",
        "int_",
        "double",
        "default",
        "register",
        "restrict",
        "inline",
        "class",
        "template",
        "operator",
        "new",
        "this",
        "namespace",
        "bool",
        "true",
        "and",
        "not_eq",
        "nullptr",
        "constexpr",
        "thread_local",
        "wchar_t",
        "asm",
        "typeof",
        "M_PI",
        "M_PI_",
        "M_PI_2",
        "I",
        "complex",
        "imaginary",
        "NULL",
        "NAN",
        "INFINITY",
        "HUGE_VAL",
        "HUGE",
        "EOF",
        "DBL_MAX",
        "DBL_EPSILON",
        "INT_MAX",
        "INT32_MAX",
        "UINT8_MAX",
        "FP_NAN",
        "OVERFLOW",
        "DOMAIN",
        "errno",
        "stdin",
        "stdout",
        "linux",
        "unix",
        "s",
        "p",
        "par",
        "fixed",
        "point",
        "values",
        "u",
        "v",
        "J",
        "F",
        "P",
        "t0",
        "t1",
        "T",
        "isnan",
        "pow",
        "sizeof",
        "MMSMITH_FN",
        "mmsmith_sine",
        "hostile_b",
        "hostile_parameters",
    ];
    let mut headers = Vec::new();
    for (number, word) in words.into_iter().enumerate() {
        let text = specification("harmless", word).replace("sin(Y)", &format!("sin({word}*Y)"));
        let spec = Spec::parse(&text, "words.toml").unwrap_or_else(|d| panic!("{word}: {d}"));
        headers.push(renamed(&header(&spec), &format!("word{number}")));
    }
    compile(&headers);
    // Two names that could become one.
    let text = specification("harmless", "int")
        .replace("E = {", "int_ = { default = 1 }\nint__ = { default = 2 }\nE = {");
    let source = header(&Spec::parse(&text, "words.toml").unwrap());
    for member in ["double int_;", "double int__;", "double int___;"] {
        assert_eq!(source.matches(member).count(), 1, "{member}");
    }
    compile(&[renamed(&source, "three")]);
}

/// The generated tokens and those of the module's text, after checking that the text parses.
fn module(spec: &Spec) -> Vec<String> {
    let source = Code::new(spec).unwrap().module_source();
    let shown: String = source.chars().take(2_000).collect();
    syn::parse_file(&source).unwrap_or_else(|e| panic!("{e}: {shown}"));
    let runtime: TokenStream = "crate".parse().unwrap();
    let mut code = skeleton(items(spec, &runtime).unwrap());
    code.extend(skeleton(source.parse().unwrap()));
    for c in source.chars() {
        assert!(c == '\n' || !c.is_control(), "{c:?} in {shown}");
        assert!(!DIRECTIONS.contains(&c), "{c:?} in {shown}");
    }
    code
}

#[test]
fn free_text_stays_text() {
    let harmless = Spec::parse(&specification("harmless", "nu"), "harmless.toml").unwrap();
    let harmless = module(&harmless);
    assert!(harmless.iter().any(|part| part == "body_force"));
    for text in hostile() {
        let shown: String = text.chars().take(60).collect();
        let spec = Spec::parse(&specification(&text, "nu"), "hostile.toml")
            .unwrap_or_else(|diagnostic| panic!("{shown:?}: {}", diagnostic.message));
        assert!(module(&spec) == harmless, "{shown:?} changes the code");
    }
}

#[test]
fn characters_that_turn_the_direction_of_text_are_refused() {
    for c in DIRECTIONS {
        let text = specification(&format!("a{c}b"), "nu");
        let diagnostic = Spec::parse(&text, "hostile.toml").unwrap_err();
        assert!(diagnostic.message.contains("direction"), "{diagnostic}");
        // Unescaped, and where nobody reads it as text.
        let comment = format!("# a{c}b\n{}", specification("harmless", "nu"));
        let diagnostic = Spec::parse(&comment, "hostile.toml").unwrap_err();
        assert_eq!(diagnostic.line_and_column(), (1, 4), "{diagnostic}");
    }
}

#[test]
fn names_that_are_words_of_rust_give_code_or_a_message() {
    let words = [
        "type",
        "self",
        "Self",
        "super",
        "crate",
        "fn",
        "T",
        "X",
        "t",
        "t0",
        "t1",
        "as",
        "async",
        "await",
        "box",
        "dyn",
        "gen",
        "impl",
        "in",
        "loop",
        "match",
        "mod",
        "move",
        "mut",
        "pub",
        "ref",
        "static",
        "struct",
        "true",
        "try",
        "union",
        "unsafe",
        "unsized",
        "use",
        "virtual",
        "yield",
        "r",
        "b",
        "br",
        "f64",
        "str",
        "Ok",
        "Err",
        "Some",
        "None",
        "value",
        "values",
        "parameters",
        "fixed",
        "time",
        "point",
        "std",
        "core",
        "main",
        "_",
        "__",
        "_a",
        "r#type",
        "a b",
        "a;b",
        "a-b",
        "",
        "'a",
        "\u{3bb}",
        "\u{430}",
        "a\u{301}",
        "1a",
        "a.b",
        "a\"b",
        "a\nb",
    ];
    let (mut generated, mut refused) = (0, 0);
    for word in words {
        match Spec::parse(&specification("harmless", word), "words.toml") {
            Ok(spec) => {
                module(&spec);
                generated += 1;
            }
            Err(diagnostic) => {
                assert!(diagnostic.to_string().contains("words.toml:"), "{diagnostic}");
                refused += 1;
            }
        }
    }
    assert!(generated > 30 && refused > 10, "{generated} {refused}");
    assert!(Spec::parse(&specification("harmless", &"a".repeat(100_000)), "long.toml").is_err());
}

#[test]
fn names_of_solutions_that_would_shadow_what_generated_code_uses_are_refused() {
    let text = specification("harmless", "nu");
    let harmless = ["a", "a1", "result-2", "my-default", "ring", "type-2"];
    let shadowing = [
        "type",
        "self",
        "result",
        "ok",
        "err",
        "some",
        "option",
        "default",
        "from",
        "t",
        "f64",
        "str",
        "usize",
        "bool",
        "std",
        "core",
        "alloc",
        "description",
        "real",
        "any-solution",
        "parameter-error",
        "ring-parameters",
        "Ring",
        "ring_2",
        "ring-",
        "-ring",
        "2d",
        "",
        "a b",
        "../ring",
        "a;b",
        "\u{3bb}",
    ];
    for name in harmless {
        let text = text.replacen("'hostile'", &quoted(name), 1);
        module(&Spec::parse(&text, "names.toml").unwrap_or_else(|d| panic!("{d}")));
    }
    for name in shadowing {
        let text = text.replacen("'hostile'", &quoted(name), 1);
        assert!(Spec::parse(&text, "names.toml").is_err(), "'{name}' was accepted");
    }
}

#[test]
fn expressions_cannot_carry_code() {
    let text = specification("harmless", "nu");
    for place in ["'A*sin(Y)*t'", "'> -1, < 1'", "'A < E'", "'neo-hookean'", "'box'", "'cartesian'"]
    {
        for hostile in hostile() {
            let text = text.replacen(place, &quoted(&hostile), 1);
            let shown: String = hostile.chars().take(60).collect();
            let diagnostic = Spec::parse(&text, "hostile.toml").map(|_| ()).expect_err(&shown);
            assert!(diagnostic.to_string().contains("hostile.toml"));
        }
    }
}
