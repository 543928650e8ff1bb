//! Text from a specification never becomes code: whatever stands in titles, descriptions and names, the generated
//! module has the items and expressions that harmless text gives, or the specification is refused with a message.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::{items, module_source};
use mmsmith_spec::Spec;
use proc_macro2::{Delimiter, TokenStream, TokenTree};
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

/// The generated tokens and those of the module's text, after checking that the text parses.
fn module(spec: &Spec) -> Vec<String> {
    let source = module_source(spec).unwrap();
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
