//! Orders that the user expects.

use std::collections::BTreeMap;

use anyhow::{Result, anyhow, bail};
use mmsmith_verify::{Expected, Norm, PerNorm, Quantity};

const FORM: &str = "expected orders such as 2, or u=2,F=1, or u.l2=2";
/// The fields of runs.
const OF_RUNS: &str = "u, v, F, P";
/// The fields of recordings.
const OF_RECORDINGS: &str = "u, v, F, P, cauchy, kirchhoff, J, density";

/// An expected order: the field, the norm or none for all of them, and the order.
type Item<'a> = (&'a str, Option<Norm>, f64);

/// Reads `2` (for `u`), `u=2,F=1` or `u.linf=2,P.l1=1`.
pub(crate) fn parse(text: &str) -> Result<Expected> {
    let mut expected = Expected::default();
    each(text, OF_RUNS, |(field, norm, order)| {
        let norms = match field {
            "u" => &mut expected.u,
            "v" => &mut expected.v,
            "F" => &mut expected.F,
            "P" => &mut expected.P,
            _ => return None,
        };
        Some(put(norms, norm, order))
    })?;
    Ok(expected)
}

/// Reads the same for fields of recordings.
pub(crate) fn of_recordings(text: &str) -> Result<BTreeMap<Quantity, PerNorm<Option<f64>>>> {
    let mut expected: BTreeMap<Quantity, PerNorm<Option<f64>>> = BTreeMap::new();
    each(text, OF_RECORDINGS, |(field, norm, order)| {
        let is_it = |quantity: &Quantity| quantity.to_string() == field;
        let field = Quantity::ALL.into_iter().find(is_it)?;
        Some(put(expected.entry(field).or_default(), norm, order))
    })?;
    Ok(expected)
}

/// Puts an order in its places; whether all of them were free.
fn put(norms: &mut PerNorm<Option<f64>>, norm: Option<Norm>, order: f64) -> bool {
    let places: Vec<&mut Option<f64>> = match norm {
        None => vec![&mut norms.linf, &mut norms.l2, &mut norms.l1],
        Some(Norm::Linf) => vec![&mut norms.linf],
        Some(Norm::L2) => vec![&mut norms.l2],
        Some(Norm::L1) => vec![&mut norms.l1],
    };
    places.into_iter().all(|place| place.replace(order).is_none())
}

/// Hands each item to `put`, which gives none for an unknown field, and false for a second order.
fn each(text: &str, fields: &str, mut put: impl FnMut(Item<'_>) -> Option<bool>) -> Result<()> {
    let form = format!("{FORM}; fields are {fields}, norms linf, l2, l1");
    for item in text.split(',') {
        let (place, order) = item.split_once('=').unwrap_or(("u", item));
        let order = order.trim().parse::<f64>().ok().filter(|order| order.is_finite());
        let Some(order) = order else { bail!("--expect: '{item}' has no order; {form}") };
        let (field, norm) = match place.trim().split_once('.') {
            Some((field, norm)) => (field, Some(norm)),
            None => (place.trim(), None),
        };
        let norm = match norm {
            None => None,
            Some("linf") => Some(Norm::Linf),
            Some("l2") => Some(Norm::L2),
            Some("l1") => Some(Norm::L1),
            Some(norm) => return Err(anyhow!("--expect: there is no norm '{norm}'; {form}")),
        };
        match put((field, norm, order)) {
            Some(true) => (),
            Some(false) => bail!("--expect: '{item}' gives an order a second time; {form}"),
            None => bail!("--expect: there is no field '{field}'; {form}"),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_read_by_field_and_norm() {
        let two = parse("2").unwrap();
        assert_eq!((two.u.linf, two.u.l1, two.F.l2), (Some(2.0), Some(2.0), None));
        let both = parse("u=2, F=1,P.l1=0.5").unwrap();
        assert_eq!((both.u.l2, both.F.linf, both.P.l1), (Some(2.0), Some(1.0), Some(0.5)));
        assert_eq!((both.P.l2, both.v.l2), (None, None));
        let more = of_recordings("u=2,cauchy.l2=1").unwrap();
        assert_eq!(
            (more[&Quantity::Displacement].l1, more[&Quantity::Cauchy].l2),
            (Some(2.0), Some(1.0))
        );
        assert_eq!(more[&Quantity::Cauchy].linf, None);
        assert!(of_recordings("w=2").unwrap_err().to_string().contains("kirchhoff"));
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        for (text, part) in [
            ("", "''"),
            ("two", "'two'"),
            ("u=", "'u='"),
            ("u=nan", "'u=nan'"),
            ("w=2", "'w'"),
            ("u.l3=2", "'l3'"),
            ("u=2,u.l2=1", "second time"),
            ("2,2", "second time"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(part) && message.contains("u=2,F=1"), "{message}");
        }
    }
}
