//! Orders that the user expects.

use anyhow::{Result, anyhow, bail};
use mmsmith_verify::{Expected, PerNorm};

const FORM: &str =
    "expected orders such as 2, or u=2,F=1, or u.l2=2; fields are u, v, F, P, norms linf, l2, l1";

/// Reads `2` (for `u`), `u=2,F=1` or `u.linf=2,P.l1=1`.
pub(crate) fn parse(text: &str) -> Result<Expected> {
    let mut expected = Expected::default();
    for item in text.split(',') {
        let (place, order) = item.split_once('=').unwrap_or(("u", item));
        let order = order.trim();
        let order = order.parse::<f64>().ok().filter(|order| order.is_finite());
        let Some(order) = order else { bail!("--expect: '{item}' has no order; {FORM}") };
        let (field, norm) = match place.trim().split_once('.') {
            Some((field, norm)) => (field, Some(norm)),
            None => (place.trim(), None),
        };
        let norms: &mut PerNorm<Option<f64>> = match field {
            "u" => &mut expected.u,
            "v" => &mut expected.v,
            "F" => &mut expected.F,
            "P" => &mut expected.P,
            _ => bail!("--expect: there is no field '{field}'; {FORM}"),
        };
        let places: Vec<&mut Option<f64>> = match norm {
            None => vec![&mut norms.linf, &mut norms.l2, &mut norms.l1],
            Some("linf") => vec![&mut norms.linf],
            Some("l2") => vec![&mut norms.l2],
            Some("l1") => vec![&mut norms.l1],
            Some(norm) => return Err(anyhow!("--expect: there is no norm '{norm}'; {FORM}")),
        };
        for place in places {
            if place.replace(order).is_some() {
                bail!("--expect: '{item}' gives an order a second time; {FORM}");
            }
        }
    }
    Ok(expected)
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
