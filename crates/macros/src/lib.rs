//! The macro `manufactured_solution!`, for crates outside this workspace.
//!
//! It makes the same items from a specification as `cargo xtask gen` writes to files, at compile time. The crate
//! that uses it has two dependencies: this one, and `mmsmith-solutions`, which holds the trait that the items implement.
//!
//! ```toml
//! [dependencies]
//! mmsmith-macros = { path = "mmsmith/crates/macros" }
//! mmsmith-solutions = { path = "mmsmith/crates/solutions" }
//! ```

use mmsmith_spec::Spec;
use proc_macro::{Span, TokenStream};
use quote::quote;
use std::path::{Path, PathBuf};
use syn::LitStr;

/// Makes the items of the solution in a specification file.
///
/// The path is relative to the file that holds the call. For a specification named `my-wave` the items are
/// `MyWave`, `MyWaveParameters` and the implementations of the trait `Solution`; a change of the file compiles
/// anew. A mistake in the specification is a compile error that shows the line and the place.
///
/// ```ignore
/// mmsmith_macros::manufactured_solution!("my-wave.toml");
/// use mmsmith_solutions::{Solution, nalgebra::SVector};
///
/// let wave = MyWave::new(MyWaveParameters { A: 0.05, ..Default::default() })?;
/// let b = wave.body_force(&SVector::<f64, 2>::new(0.3, 0.6), 0.01);
/// ```
#[proc_macro]
pub fn manufactured_solution(input: TokenStream) -> TokenStream {
    let path = syn::parse_macro_input!(input as LitStr);
    match expand(&path) {
        Ok(items) => items,
        Err(message) => syn::Error::new(path.span(), message).to_compile_error().into(),
    }
}

fn expand(given: &LitStr) -> Result<TokenStream, String> {
    let path = resolve(Path::new(&given.value()))?;
    let shown = path.display().to_string();
    let text =
        std::fs::read_to_string(&path).map_err(|error| format!("cannot read {shown}: {error}"))?;
    let spec = Spec::parse(&text, &given.value()).map_err(|diagnostic| diagnostic.to_string())?;
    let items = mmsmith_codegen::items(&spec, &quote!(::mmsmith_solutions))
        .map_err(|error| format!("cannot derive the fields of {}: {error}", given.value()))?;
    // Naming the file in the output makes cargo compile anew when it changes.
    Ok(quote! {
        const _: &[u8] = include_bytes!(#shown);
        #items
    }
    .into())
}

/// The absolute path of a file given relative to the calling file.
fn resolve(given: &Path) -> Result<PathBuf, String> {
    let caller = Span::call_site()
        .local_file()
        .ok_or_else(|| "the file that calls the macro is not known".to_owned())?;
    let relative = caller.parent().unwrap_or(Path::new("")).join(given);
    std::path::absolute(&relative)
        .map_err(|error| format!("cannot resolve {}: {error}", relative.display()))
}
