//! Rules for every generated Rust module by itself.

#![allow(clippy::unwrap_used)]

use mmsmith_codegen::{Code, items};
use mmsmith_spec::Spec;
use quote::quote;
use std::path::Path;

/// Words of the language are raw identifiers, and all else is called as the specification says.
#[test]
fn parameters_have_names_that_rust_takes() {
    for (name, identifier) in [
        ("A", "A"),
        ("nu_0", "nu_0"),
        ("type", "r#type"),
        ("async", "r#async"),
        ("gen", "r#gen"),
        ("union", "union"),
        ("static", "r#static"),
    ] {
        let text = format!(
            "name = 'test'\ntitle = 'Test'\ncoordinates = 'cartesian'\ndimension = 1\n\
             [parameters]\n{name} = {{ default = 0.1, range = '> -1e400, < 1e400' }}\n\
             [displacement]\nX = '{name}*X*t'\n\
             [material]\nlaw = 'neo-hookean'\nlambda = 1\nmu = 1\ndensity = 1\n\
             [domain]\nshape = 'box'\nlower = [0]\nupper = [1]\n\
             [time]\nperiod = 1\n"
        );
        let spec = Spec::parse(&text, "test.toml").unwrap_or_else(|d| panic!("{d}"));
        let source = Code::new(&spec).unwrap().module_source();
        syn::parse_file(&source).unwrap_or_else(|e| panic!("{name}: {e}\n{source}"));
        assert!(source.contains(&format!("pub {identifier}: T,")), "{name}\n{source}");
        let bounds = "value > -f64::INFINITY && value < f64::INFINITY";
        assert!(source.contains(bounds), "{source}");
    }
}

/// Statements are formatted in one way for files and in another for macros; the items are the same.
#[test]
fn a_macro_puts_the_items_of_the_file() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../mms-specs");
    for name in ["bar", "ring", "axis-aligned", "rigid-motion"] {
        let text = std::fs::read_to_string(folder.join(name).with_extension("toml")).unwrap();
        let spec = Spec::parse(&text, name).unwrap_or_else(|d| panic!("{d}"));
        let code = Code::new(&spec).unwrap();
        let mut file = syn::parse_file(&code.module_source()).unwrap();
        // What only the file says: where it comes from.
        file.attrs.clear();
        let expected = prettyplease::unparse(&file);
        for found in [code.items(&quote!(crate)), items(&spec, &quote!(crate)).unwrap()] {
            assert_eq!(prettyplease::unparse(&syn::parse2(found).unwrap()), expected, "{name}");
        }
    }
}
