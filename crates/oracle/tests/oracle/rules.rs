//! Each rule of the derivation has a specification that is lost without it. `cargo xtask ablation` names all of them.
#![allow(clippy::unwrap_used)]

use mmsmith_expr::Rule;
use mmsmith_expr::rules::{Row, Serves};
use mmsmith_oracle::{LARGEST_FACTOR, ablated};
use std::path::Path;

/// In each class, as many as `cargo xtask ablation` draws.
const POINTS: u64 = 100;

fn text(name: &str) -> String {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let specs = "tests/data/specs";
    let folders = ["mms-specs".to_owned(), specs.to_owned()].into_iter();
    let folders = folders.chain(["digits", "materials", "attack"].map(|f| format!("{specs}/{f}")));
    let mut files = folders.map(|folder| repository.join(folder).join(name).with_extension("toml"));
    let file =
        files.find(|file| file.exists()).unwrap_or_else(|| panic!("no specification {name}"));
    std::fs::read_to_string(file).unwrap()
}

/// The first specification that a rule names is lost without it, and keeps its digits with it.
#[test]
#[ignore = "half a minute: .ci/long runs it"]
fn each_rule_is_needed() {
    for row @ Row { name, serves, needed_by, .. } in Rule::ALL {
        assert!(needed_by.is_sorted(), "{name}");
        let victim = needed_by.first().unwrap_or_else(|| panic!("{name} serves nobody: delete it"));
        let points = if *serves == Serves::Digits { POINTS } else { 0 };
        let row = std::slice::from_ref(row);
        let (_, effects) = ablated(&text(victim), row, points, &|_, _| 0).unwrap();
        let effect = effects.into_iter().next().flatten();
        let effect = effect.unwrap_or_else(|| panic!("without {name} nothing changes in {victim}"));
        match serves {
            Serves::Digits => {
                let loss = effect
                    .loss
                    .unwrap_or_else(|| panic!("{victim} keeps its digits without {name}"));
                assert!(loss.with <= LARGEST_FACTOR && loss.without.factor > LARGEST_FACTOR);
            }
            Serves::Work => {
                assert!(effect.work >= 1.25, "{victim} without {name}: {}", effect.work)
            }
        }
    }
}
