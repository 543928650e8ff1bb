//! Names that C, C++ and CUDA take.

use mmsmith_spec::Parameter;

/// Words of C, C++ and CUDA, and macros of their usual headers, that cannot name a member of a structure.
const C_WORDS: &[&str] = &[
    "BUFSIZ",
    "CHAR_BIT",
    "DOMAIN",
    "EDOM",
    "EILSEQ",
    "EOF",
    "ERANGE",
    "FILENAME_MAX",
    "HUGE",
    "HUGE_VAL",
    "HUGE_VALF",
    "HUGE_VALL",
    "I",
    "INFINITY",
    "MAXFLOAT",
    "NAN",
    "NULL",
    "OVERFLOW",
    "PLOSS",
    "RAND_MAX",
    "SING",
    "TLOSS",
    "UNDERFLOW",
    "alignas",
    "alignof",
    "and",
    "and_eq",
    "asm",
    "assert",
    "auto",
    "bitand",
    "bitor",
    "bool",
    "break",
    "case",
    "catch",
    "char",
    "char16_t",
    "char32_t",
    "char8_t",
    "class",
    "co_await",
    "co_return",
    "co_yield",
    "compl",
    "complex",
    "concept",
    "const",
    "const_cast",
    "consteval",
    "constexpr",
    "constinit",
    "continue",
    "decltype",
    "default",
    "delete",
    "do",
    "double",
    "dynamic_cast",
    "else",
    "enum",
    "errno",
    "explicit",
    "export",
    "extern",
    "false",
    "far",
    "float",
    "for",
    "fortran",
    "friend",
    "goto",
    "i386",
    "if",
    "imaginary",
    "inline",
    "int",
    "interface",
    "linux",
    "long",
    "math_errhandling",
    "max",
    "min",
    "mutable",
    "namespace",
    "near",
    "new",
    "noexcept",
    "noreturn",
    "not",
    "not_eq",
    "nullptr",
    "operator",
    "or",
    "or_eq",
    "private",
    "protected",
    "public",
    "register",
    "reinterpret_cast",
    "requires",
    "restrict",
    "return",
    "short",
    "signed",
    "sizeof",
    "small",
    "static",
    "static_assert",
    "static_cast",
    "stderr",
    "stdin",
    "stdout",
    "struct",
    "switch",
    "template",
    "this",
    "thread_local",
    "throw",
    "true",
    "try",
    "typedef",
    "typeid",
    "typename",
    "typeof",
    "typeof_unqual",
    "union",
    "unix",
    "unsigned",
    "using",
    "virtual",
    "void",
    "volatile",
    "wchar_t",
    "while",
    "xor",
    "xor_eq",
];

/// Prefixes of families of macros.
const C_FAMILIES: &[&str] = &[
    "CHAR_", "DBL_", "DECIMAL_", "FE_", "FLT_", "FP_", "INT", "LDBL_", "LLONG_", "LONG_", "MATH_",
    "MMSMITH_", "M_", "SCHAR_", "SHRT_", "SIZE_", "UCHAR_", "UINT", "ULLONG_", "ULONG_", "USHRT_",
];

/// Whether C has this word, or may have a macro of this name.
fn is_taken(name: &str) -> bool {
    C_WORDS.contains(&name) || C_FAMILIES.iter().any(|family| name.starts_with(family))
}

/// The name, with an underscore at its end where C has it already.
pub(crate) fn c_name(name: &str) -> String {
    if is_taken(name) { format!("{name}_") } else { name.to_owned() }
}

/// The names of parameters as members of a structure. A name that C has already gets an underscore at its end, and more underscores
/// where another parameter has that name.
pub(crate) fn members(parameters: &[Parameter]) -> Vec<String> {
    let plain = |name: &str| parameters.iter().any(|p| p.name == name && !is_taken(name));
    // All names differ: underscores are added past the names of other parameters that C does not have.
    let member = |parameter: &Parameter| {
        let mut member = parameter.name.clone();
        if is_taken(&member) {
            member.push('_');
            while plain(&member) {
                member.push('_');
            }
        }
        member
    };
    parameters.iter().map(member).collect()
}
