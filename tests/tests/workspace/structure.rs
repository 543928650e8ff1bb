//! The modules of each crate use each other in one direction: each can be read after those that it uses. And what the manifests say
//! about tests is so.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::path::Path;

use mmsmith_tests::workspace;
use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;
use syn::{Attribute, Item, UseTree};

/// The place of a module in its crate, from the root on.
type Place = Vec<String>;

/// The files of a crate by their modules, without the root and without tests.
fn files(folder: &Path, place: &Place, files: &mut BTreeMap<Place, syn::File>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let inner = || place.iter().cloned().chain([name.clone()]).collect();
        if path.is_dir() {
            self::files(&path, &inner(), files);
            continue;
        }
        let module = match name.as_str() {
            "lib" | "main" | "tests" => continue,
            "mod" => place.clone(),
            _ => inner(),
        };
        if path.extension().is_none_or(|extension| extension != "rs") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        files.insert(module, syn::parse_file(&text).unwrap());
    }
}

fn is_test(attributes: &[Attribute]) -> bool {
    let text = |attribute: &Attribute| attribute.to_token_stream().to_string().replace(' ', "");
    attributes.iter().any(|attribute| text(attribute) == "#[cfg(test)]")
}

/// The paths that a module names, as it writes them.
fn paths(file: &syn::File) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    for item in &file.items {
        match item {
            Item::Use(item) if !is_test(&item.attrs) => flatten(&item.tree, &[], &mut paths),
            Item::Mod(item) if is_test(&item.attrs) => {}
            Item::Use(_) => {}
            item => scan(item.to_token_stream(), &mut paths),
        }
    }
    paths
}

fn flatten(tree: &UseTree, before: &[String], paths: &mut Vec<Vec<String>>) {
    let with = |last: String| before.iter().cloned().chain([last]).collect::<Vec<_>>();
    match tree {
        UseTree::Path(path) => flatten(&path.tree, &with(path.ident.to_string()), paths),
        UseTree::Group(group) => group.items.iter().for_each(|tree| flatten(tree, before, paths)),
        UseTree::Name(name) => paths.push(with(name.ident.to_string())),
        UseTree::Rename(name) => paths.push(with(name.ident.to_string())),
        _ => paths.push(before.to_vec()),
    }
}

/// Paths of the form `crate::a::b` within other code.
fn scan(tokens: TokenStream, paths: &mut Vec<Vec<String>>) {
    let mut path: Vec<String> = Vec::new();
    for token in tokens {
        match token {
            TokenTree::Ident(word) if path.is_empty() && word == "crate" => {
                path = vec!["crate".into()];
            }
            TokenTree::Ident(word) if !path.is_empty() => path.push(word.to_string()),
            TokenTree::Punct(punctuation) if punctuation.as_char() == ':' => continue,
            TokenTree::Group(group) => {
                paths.push(std::mem::take(&mut path));
                scan(group.stream(), paths);
            }
            _ => paths.push(std::mem::take(&mut path)),
        }
    }
    paths.push(path);
}

/// The module that a path of the module `own` leads to, if it is one of the same crate.
fn target(own: &Place, path: &[String], files: &BTreeMap<Place, syn::File>) -> Option<Place> {
    let ups = path.iter().take_while(|part| *part == "super").count();
    let mut place: Place = match path.first()?.as_str() {
        "crate" => path[1..].to_vec(),
        "super" => own[..own.len() - ups].iter().chain(&path[ups..]).cloned().collect(),
        "self" => own.iter().chain(&path[1..]).cloned().collect(),
        _ => return None,
    };
    while !place.is_empty() {
        if files.contains_key(&place) {
            return Some(place);
        }
        place.pop();
    }
    None
}

/// A circle of modules that use each other; a folder's own file and those in the folder are taken for one.
fn circle(uses: &BTreeMap<Place, Vec<Place>>) -> Option<Vec<Place>> {
    fn follow(
        at: &Place,
        way: &mut Vec<Place>,
        done: &mut Vec<Place>,
        uses: &BTreeMap<Place, Vec<Place>>,
    ) -> bool {
        if let Some(start) = way.iter().position(|place| place == at) {
            way.drain(..start);
            return true;
        }
        if done.contains(at) {
            return false;
        }
        way.push(at.clone());
        if uses[at].iter().any(|next| follow(next, way, done, uses)) {
            return true;
        }
        way.pop();
        done.push(at.clone());
        false
    }
    let mut done = Vec::new();
    uses.keys().find_map(|at| {
        let mut way = Vec::new();
        follow(at, &mut way, &mut done, uses).then_some(way)
    })
}

/// Who uses whom in a crate.
fn uses(folder: &Path) -> BTreeMap<Place, Vec<Place>> {
    let mut all = BTreeMap::new();
    files(folder, &Vec::new(), &mut all);
    let of = |(own, file): (&Place, &syn::File)| {
        let targets = paths(file).into_iter().filter_map(|path| target(own, &path, &all));
        let apart = |other: &Place| !other.starts_with(own) && !own.starts_with(other);
        (own.clone(), targets.filter(apart).collect())
    };
    all.iter().map(of).collect()
}

#[test]
fn modules_use_each_other_in_one_direction() {
    let mut read = 0;
    for package in std::fs::read_dir(workspace().join("crates")).unwrap() {
        let package = package.unwrap().path();
        let uses = uses(&package.join("src"));
        read += uses.len();
        let shown = package.display();
        assert_eq!(
            circle(&uses),
            None,
            "{shown}: each of these uses the next, and the last the first"
        );
        let is_large = package.ends_with("mpm") || package.ends_with("verify");
        let is_read = uses.len() > 30 && uses.values().any(|others| others.len() > 3);
        assert!(is_read || !is_large, "{shown}: {} modules", uses.len());
    }
    assert!(read > 300, "{read} modules");
}

#[test]
fn a_circle_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("a.rs", "use crate::{b::{self, B}, d};\n#[cfg(test)] mod tests { use crate::a; }");
    write("b.rs", "pub struct B;\nfn f() -> Option<u8> { crate::c::g(&[1]) }");
    write("c.rs", "use super::d::D;");
    write("d.rs", "pub struct D;");
    assert_eq!(circle(&uses(folder.path())), None);
    write("d.rs", "fn f(x: u8) { if x > 0 { crate::b::B; } }");
    let names: Vec<_> = circle(&uses(folder.path())).unwrap().concat();
    assert_eq!(names, ["b", "c", "d"]);
}

/// The code that is judged is the code that is generated as long as all of it comes out of one pipeline.
#[test]
fn the_passes_over_a_program_are_called_from_one_place() {
    fn callers(folder: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                callers(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs")
                && std::fs::read_to_string(&path).unwrap().contains(".with_gathered_factors(")
            {
                found.push(path.strip_prefix(workspace()).unwrap().display().to_string());
            }
        }
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(workspace().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        // The crate that has them calls them in its own tests.
        if !folder.ends_with("expr") {
            callers(&folder.join("src"), &mut found);
        }
    }
    assert_eq!(found, ["crates/stage/src/staged.rs"]);
}

/// Doc comments that may begin with a pronoun; the list only shrinks.
const PRONOUNS_FIRST: [(&str, &str); 2] = [
    ("crates/cli/src/arguments/scheme.rs", "Those of the updated Lagrangian formulation"),
    ("crates/codegen/src/rust/mod.rs", "What depends on the parameters only."),
];

/// A reader whose first language is another one finds the subject at the start of a doc comment.
#[test]
fn doc_comments_name_their_subject_first() {
    fn comments(folder: &Path, found: &mut Vec<(String, String)>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let shown = path.strip_prefix(workspace()).unwrap().display().to_string();
            if path.is_dir() && !path.ends_with("generated") && !path.ends_with("target") {
                comments(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                // The first line of each comment.
                let mut before = "";
                for line in text.lines().map(str::trim_start) {
                    let comment = ["/// ", "//! "].iter().find_map(|mark| line.strip_prefix(mark));
                    if let Some(comment) = comment.filter(|_| !before.starts_with("//")) {
                        found.push((shown.clone(), comment.to_owned()));
                    }
                    before = line;
                }
            }
        }
    }
    let mut found = Vec::new();
    for folder in ["crates", "xtask/src", "tests/src", "tests/tests", "python/src"] {
        comments(&workspace().join(folder), &mut found);
    }
    assert!(found.len() > 3000, "{}", found.len());
    let is_pronoun =
        |text: &str| ["What ", "Those ", "The same ", "Of "].iter().any(|w| text.starts_with(w));
    let is_exempt = |(file, text): &(String, String)| {
        PRONOUNS_FIRST.iter().any(|(f, t)| file == f && text.starts_with(t))
    };
    let wrong: Vec<_> = found.iter().filter(|c| is_pronoun(&c.1) && !is_exempt(c)).collect();
    assert!(wrong.is_empty(), "begin with a noun or a verb: {wrong:#?}");
    for (file, text) in PRONOUNS_FIRST {
        let is_there = found.iter().any(|(f, t)| f == file && t.starts_with(text));
        assert!(is_there, "no exception is needed any more: {file}: {text}");
    }
}

/// Whether Rust's tools would find something to run in a line of documentation that opens a block.
fn opens_an_example(line: &str) -> bool {
    let comment = ["///", "//!"].iter().find_map(|mark| line.trim_start().strip_prefix(mark));
    comment.is_some_and(|text| {
        text.trim_start().strip_prefix("```").is_some_and(|language| language != "text")
    })
}

/// The text of all files of a folder, without the lines that close blocks of documentation.
fn text_of(folder: &Path, text: &mut String) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text_of(&path, text);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let mut is_in_block = false;
            for line in std::fs::read_to_string(&path).unwrap().lines() {
                let is_fence =
                    ["/// ```", "//! ```"].iter().any(|m| line.trim_start().starts_with(m));
                if !(is_fence && is_in_block) {
                    *text += line;
                    text.push('\n');
                }
                is_in_block ^= is_fence;
            }
        }
    }
}

/// A library without tests is not compiled for them, one without examples is not searched for any; and none has tests that never run.
#[test]
fn manifests_say_which_libraries_have_tests_and_examples() {
    let root = workspace();
    let crates = std::fs::read_dir(root.join("crates")).unwrap().map(|e| e.unwrap().path());
    let mut without = [0, 0];
    for package in crates.chain([root.join("tests")]) {
        let manifest = std::fs::read_to_string(package.join("Cargo.toml")).unwrap();
        let manifest: toml::Table = toml::from_str(&manifest).unwrap();
        let says = |key: &str| {
            let said = manifest.get("lib").and_then(|lib| lib.get(key));
            said.is_none_or(|value| value.as_bool().unwrap())
        };
        let mut text = String::new();
        text_of(&package.join("src"), &mut text);
        let has_tests = text.lines().any(|line| line.trim_start().starts_with("#[test]"));
        let has_examples = text.contains("cfg(doctest)") || text.lines().any(opens_an_example);
        for (k, (key, has)) in
            [("test", has_tests), ("doctest", has_examples)].into_iter().enumerate()
        {
            let shown = package.display();
            assert_eq!(
                says(key),
                has,
                "{shown}/Cargo.toml: `{key} = false` in [lib] is for a library without"
            );
            without[k] += usize::from(!has);
        }
    }
    assert!(without.into_iter().all(|count| count > 5), "{without:?}");
}
