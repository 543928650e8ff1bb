//! Error against cost, both logarithmic, with the front.

use std::fmt::Write;

use super::plot::{Axis, BOTTOM, LEFT, LEGEND, LINE, RIGHT, TOP, WIDTH, frame, grid, marker};
use super::{escape, open};

/// The colour of the front, which no marker has.
const RED: &str = "#cc0000";

/// One measured setting.
pub(crate) struct Point {
    /// The kind; points of one kind are drawn alike.
    pub(crate) kind: String,
    pub(crate) cost: f64,
    pub(crate) error: f64,
    pub(crate) on_front: bool,
}

/// Settings by cost and error.
pub(crate) struct Front<'a> {
    pub(crate) title: &'a str,
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    pub(crate) points: Vec<Point>,
}

impl Front<'_> {
    pub(crate) fn svg(&self) -> String {
        let drawn: Vec<&Point> = self
            .points
            .iter()
            .filter(|p| p.cost > 0.0 && p.error > 0.0 && p.cost.is_finite() && p.error.is_finite())
            .collect();
        let mut kinds: Vec<&str> = Vec::new();
        for point in &drawn {
            if !kinds.contains(&point.kind.as_str()) {
                kinds.push(&point.kind);
            }
        }
        kinds.sort_unstable();
        let height = LEGEND + LINE * (kinds.len() + 1) as f64;
        let count = drawn.iter().filter(|point| point.on_front).count();
        let told = format!("{} settings, {count} of them on the front.", drawn.len());
        let mut text = open("front", WIDTH, height, self.title, &told);
        let _ = writeln!(
            text,
            r##"<text x="{LEFT}" y="22" font-size="15" font-weight="bold">{}</text>"##,
            escape(self.title)
        );
        if !drawn.is_empty() {
            let x = Axis::around(drawn.iter().map(|p| p.cost), LEFT, RIGHT);
            let y = Axis::around(drawn.iter().map(|p| p.error), BOTTOM, TOP);
            grid(&mut text, &x, &y);
            for (index, kind) in kinds.iter().enumerate() {
                let _ = writeln!(text, r##"<g class="kind" data-name="{}">"##, escape(kind));
                for point in drawn.iter().filter(|point| point.kind == *kind) {
                    marker(&mut text, index, x.at(point.cost), y.at(point.error));
                }
                text.push_str("</g>\n");
            }
            let mut front: Vec<&&Point> = drawn.iter().filter(|point| point.on_front).collect();
            front.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            let places: Vec<String> =
                front.iter().map(|p| format!("{:.1},{:.1}", x.at(p.cost), y.at(p.error))).collect();
            let _ = writeln!(
                text,
                r##"<g class="curve" data-name="front" data-colour="{RED}"><polyline class="pareto" points="{}" fill="none" stroke="{RED}" stroke-width="2"/></g>"##,
                places.join(" ")
            );
        }
        frame(&mut text, self.x, self.y);
        for (index, kind) in kinds.iter().enumerate() {
            let line = LEGEND + LINE * index as f64;
            marker(&mut text, index, LEFT + 22.0, line);
            let _ = writeln!(
                text,
                r##"<text x="{}" y="{}">{}</text>"##,
                LEFT + 54.0,
                line + 5.0,
                escape(kind)
            );
        }
        let line = LEGEND + LINE * kinds.len() as f64;
        let _ = writeln!(
            text,
            r##"<path d="M{LEFT} {line}h44" stroke="{RED}" stroke-width="2"/><text x="{}" y="{}">front</text>"##,
            LEFT + 54.0,
            line + 5.0
        );
        text.push_str("</svg>\n");
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_drawn_from_cheap_to_dear_and_what_has_no_logarithm_is_left_out() {
        let point =
            |kind: &str, cost, error, on_front| Point { kind: kind.into(), cost, error, on_front };
        let points = vec![
            point("b<", 10.0, 1e-4, true),
            point("a", 1.0, 1e-2, true),
            point("a", 5.0, 2e-2, false),
            point("c", 5.0, f64::NAN, false),
            point("c", 0.0, 1e-3, false),
        ];
        let text = Front { title: "t", x: "s", y: "e", points }.svg();
        assert!(text.contains("3 settings, 2 of them on the front"), "{text}");
        assert_eq!(text.matches("class=\"kind\"").count(), 2);
        assert!(text.contains("data-name=\"b&lt;\"") && !text.contains("data-name=\"c\""));
        let line =
            text.split("class=\"pareto\" points=\"").nth(1).and_then(|t| t.split('"').next());
        let xs: Vec<f64> = line
            .into_iter()
            .flat_map(|line| line.split(' '))
            .map(|p| p.split(',').next().and_then(|x| x.parse().ok()).expect("a number"))
            .collect();
        assert!(xs.len() == 2 && xs[0] < xs[1], "{xs:?}");
        assert!(Front { title: "t", x: "s", y: "e", points: vec![] }.svg().ends_with("</svg>\n"));
    }
}
