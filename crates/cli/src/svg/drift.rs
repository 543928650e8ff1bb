//! A difference over time, which may be gained or lost.

use std::fmt::Write;

use super::plot::{BOTTOM, LEFT, LEGEND, LINE, RIGHT, TOP, WIDTH, frame, marker, style};
use super::{escape, number, open, round_values, rounded};

/// Where the columns of the legend end.
const COLUMNS: [f64; 3] = [RIGHT - 164.0, RIGHT - 86.0, RIGHT];
/// Markers on a curve.
const MARKERS: usize = 8;
/// Where one curve goes this many times as far as another, small values are given more room.
const APART: f64 = 20.0;

/// Curves over time. The axes are linear; with curves of very different sizes that of the values is logarithmic away from zero.
pub(crate) struct Drift<'a> {
    pub(crate) title: &'a str,
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    pub(crate) curves: Vec<Course>,
}

/// One curve, by time.
pub(crate) struct Course {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
}

/// An axis: values from `low` to `high`, drawn from `start` to `end`.
struct Axis {
    low: f64,
    high: f64,
    start: f64,
    end: f64,
    /// The size from which on it is logarithmic rather than linear.
    bend: Option<f64>,
}

impl Axis {
    fn at(&self, value: f64) -> f64 {
        let place = |value: f64| self.bend.map_or(value, |bend| (value / bend).asinh());
        let share = (place(value) - place(self.low)) / (place(self.high) - place(self.low));
        self.start + share * (self.end - self.start)
    }

    /// Zero, and powers of ten either way with their double and fivefold, as far as they keep clear of each other.
    fn bent_ticks(&self, bend: f64) -> Vec<f64> {
        const ROOM: f64 = 20.0;
        let powers = bend.log10().floor() as i32..=self.high.max(-self.low).log10().ceil() as i32;
        // Powers of ten first, since they are to be kept.
        let sizes = [1, 5, 2].map(|m| powers.clone().map(move |power| format!("{m}e{power}")));
        let sizes = sizes.into_iter().flatten().filter_map(|size| size.parse::<f64>().ok());
        let mut ticks = vec![0.0];
        for tick in sizes.flat_map(|size| [size, -size]) {
            let is_clear = |other: &f64| (self.at(*other) - self.at(tick)).abs() >= ROOM;
            if (self.low..=self.high).contains(&tick) && ticks.iter().all(is_clear) {
                ticks.push(tick);
            }
        }
        ticks
    }

    /// Round values, or powers of ten where the axis is bent.
    fn ticks(&self) -> Vec<f64> {
        if let Some(bend) = self.bend {
            return self.bent_ticks(bend);
        }
        round_values(self.low, self.high, 8.0)
    }
}

impl Course {
    /// How far it goes from zero.
    fn size(&self) -> f64 {
        let sizes = self.points.iter().map(|point| point.1.abs());
        sizes.filter(|size| size.is_finite()).fold(0.0, f64::max)
    }

    /// Its least and its largest value, as far as they are below and above zero, and its last one.
    fn ends(&self) -> Option<[f64; 3]> {
        let finite = || self.points.iter().map(|point| point.1).filter(|value| value.is_finite());
        let (least, most) = finite().fold((0.0_f64, 0.0_f64), |(l, m), v| (l.min(v), m.max(v)));
        finite().next_back().map(|last| [least, most, last])
    }

    /// The curve in words.
    fn label(&self) -> String {
        match self.ends() {
            None => format!("{}: none", self.name),
            Some(ends) => {
                let [least, most, last] = ends.map(told);
                format!("{}: from {least} to {most}, {last} at the end", self.name)
            }
        }
    }
}

/// Two digits, but for zero.
fn told(value: f64) -> String {
    if value == 0.0 { "0".into() } else { format!("{value:.1e}") }
}

impl Drift<'_> {
    pub(crate) fn svg(&self) -> String {
        let labels: Vec<_> = self.curves.iter().map(Course::label).collect();
        let height = LEGEND + LINE * (labels.len() + 1) as f64;
        let mut text = open("plot", WIDTH, height, self.title, &format!("{}.", labels.join("; ")));
        let _ = writeln!(
            text,
            r##"<text x="{LEFT}" y="22" font-size="15" font-weight="bold">{}</text>"##,
            escape(self.title)
        );
        let known = |point: &&(f64, f64)| point.0.is_finite() && point.1.is_finite();
        let points = || self.curves.iter().flat_map(|curve| &curve.points).filter(known);
        if points().next().is_some() {
            let end = points().map(|point| point.0).fold(0.0, f64::max);
            let (low, high) =
                points().fold((0.0_f64, 0.0_f64), |(l, h), p| (l.min(p.1), h.max(p.1)));
            // Something to draw where all are zero, and room above and below.
            let room = if high > low { 0.06 * (high - low) } else { 1.0 };
            let x = Axis {
                low: 0.0,
                high: if end > 0.0 { end } else { 1.0 },
                start: LEFT,
                end: RIGHT,
                bend: None,
            };
            let bend = self.bend();
            let y = Axis { low: low - room, high: high + room, start: BOTTOM, end: TOP, bend };
            if bend.is_some() {
                let _ = writeln!(
                    text,
                    r##"<text x="{RIGHT}" y="22" text-anchor="end" font-size="13" fill="#444">log away from zero</text>"##
                );
            }
            lines(&mut text, &x, &y);
            for (index, curve) in self.curves.iter().enumerate() {
                let (colour, dash) = style(index);
                let places: Vec<_> =
                    curve.points.iter().filter(known).map(|p| (x.at(p.0), y.at(p.1))).collect();
                let told: Vec<_> = places.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                let _ = writeln!(
                    text,
                    r##"<g class="curve" data-name="{}" data-colour="{colour}"><polyline points="{}" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"/>"##,
                    escape(&curve.name),
                    told.join(" ")
                );
                // Each curve's at other times, so that curves upon each other are told apart.
                let shift = (index as f64 + 0.5) / self.curves.len() as f64;
                for n in 0..MARKERS {
                    let share = (n as f64 + shift) / MARKERS as f64;
                    if let Some(&(x, y)) = places.get((share * places.len() as f64) as usize) {
                        marker(&mut text, index, x, y);
                    }
                }
                text.push_str("</g>\n");
            }
        }
        frame(&mut text, self.x, self.y);
        for (column, head) in COLUMNS.iter().zip(["least", "largest", "at the end"]) {
            let _ = writeln!(
                text,
                r##"<text x="{column}" y="{}" text-anchor="end" font-size="13" fill="#444">{head}</text>"##,
                LEGEND + 4.0
            );
        }
        for (index, curve) in self.curves.iter().enumerate() {
            let (colour, dash) = style(index);
            let line = LEGEND + LINE * (index + 1) as f64;
            let _ = writeln!(
                text,
                r##"<path d="M{LEFT} {line}h44" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"/>"##
            );
            marker(&mut text, index, LEFT + 22.0, line);
            let _ = writeln!(
                text,
                r##"<text x="{}" y="{}">{}</text>"##,
                LEFT + 54.0,
                line + 5.0,
                escape(&curve.name)
            );
            for (column, end) in COLUMNS.iter().zip(curve.ends().into_iter().flatten()) {
                let _ = writeln!(
                    text,
                    r##"<text x="{column}" y="{}" text-anchor="end" font-size="13">{}</text>"##,
                    line + 5.0,
                    rounded(end, 2)
                );
            }
        }
        text.push_str("</svg>\n");
        text
    }

    /// Where the axis of values becomes logarithmic, if it does: within the smallest curve's values.
    fn bend(&self) -> Option<f64> {
        let sizes = || self.curves.iter().map(Course::size).filter(|size| *size > 0.0);
        let (least, most) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
        (most > APART * least).then_some(least / 4.0)
    }
}

/// The lines of the grid, with their values.
fn lines(text: &mut String, x: &Axis, y: &Axis) {
    for tick in x.ticks() {
        let at = x.at(tick);
        let _ = writeln!(
            text,
            r##"<path d="M{at:.1} {TOP}V{BOTTOM}" stroke="#ddd"/><text x="{at:.1}" y="{:.1}" text-anchor="middle" font-size="13">{}</text>"##,
            BOTTOM + 18.0,
            number(tick)
        );
    }
    for tick in y.ticks() {
        let (at, colour) = (y.at(tick), if tick == 0.0 { "#777" } else { "#ddd" });
        let _ = writeln!(
            text,
            r##"<path d="M{LEFT} {at:.1}H{RIGHT}" stroke="{colour}"/><text x="{:.1}" y="{:.1}" text-anchor="end" font-size="13">{}</text>"##,
            LEFT - 6.0,
            at + 5.0,
            number(tick)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn svg(points: &[(f64, f64)]) -> String {
        let curves = vec![Course { name: "a<b".into(), points: points.to_vec() }];
        Drift { title: "t", x: "periods", y: "drift", curves }.svg()
    }

    #[test]
    fn gains_are_above_zero_and_losses_below() {
        let text = svg(&[(0.0, 0.0), (1.0, 2e-3), (2.0, -1e-3), (3.0, f64::NAN)]);
        let points = text.split("points=\"").nth(1).and_then(|rest| rest.split('"').next());
        let heights: Vec<f64> = points
            .into_iter()
            .flat_map(|points| points.split(' '))
            .map(|p| p.split(',').nth(1).and_then(|y| y.parse().ok()).expect("a number"))
            .collect();
        assert_eq!(heights.len(), 3, "{text}");
        assert!(heights[1] < heights[0] && heights[0] < heights[2], "{heights:?}");
        assert!((heights[0] - heights[1] - 2.0 * (heights[2] - heights[0])).abs() < 0.2);
        assert!(text.contains("a&lt;b: from -1.0e-3 to 2.0e-3, -1.0e-3 at the end"), "{text}");
        assert!(text.contains(">2·10⁻³<") && text.contains(">-10⁻³<"), "{text}");
    }

    #[test]
    fn the_legend_is_a_table_so_that_no_line_of_it_is_cut() {
        let text = svg(&[(0.0, 0.0), (1.0, 0.123), (2.0, -4.56e-9)]);
        let at = |column: f64| format!(r##"<text x="{column}" y="{}""##, LEGEND + LINE + 5.0);
        for (column, told) in COLUMNS.into_iter().zip(["-4.6·10⁻⁹", "0.12", "-4.6·10⁻⁹"])
        {
            let line = text.lines().find(|line| line.starts_with(&at(column)));
            assert!(line.is_some_and(|line| line.contains(&format!(">{told}<"))), "{told}: {text}");
        }
    }

    #[test]
    fn small_curves_beside_large_ones_are_given_room() {
        let course = |name: &str, size: f64| Course {
            name: name.into(),
            points: (0..100).map(|n| (f64::from(n), size * f64::from(n) / 99.0)).collect(),
        };
        let of = |curves| Drift { title: "t", x: "periods", y: "drift", curves };
        assert_eq!(of(vec![course("a", 1.0), course("b", -0.2)]).bend(), None);
        let bent = of(vec![course("a", 4.0), course("b", 0.08), course("c", 0.0)]);
        assert_eq!(bent.bend(), Some(0.02));
        let text = bent.svg();
        let ends: Vec<f64> = text
            .split("points=\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next()?.rsplit(',').next()?.parse().ok())
            .collect();
        // On a linear axis the second would end at a fiftieth of the first's height.
        let share = (ends[2] - ends[1]) / (ends[2] - ends[0]);
        assert!((0.2..0.6).contains(&share), "{ends:?}");
        assert!(text.contains("log away from zero"), "{text}");
        assert!(text.contains(">0<") && text.contains(">0.1<") && text.contains(">1<"), "{text}");
    }

    #[test]
    fn nothing_to_draw_is_still_a_picture() {
        for points in [&[][..], &[(0.0, f64::NAN)], &[(0.0, 0.0)], &[(0.0, 0.0), (5.0, 0.0)]] {
            let text = svg(points);
            assert!(text.ends_with("</svg>\n") && !text.contains("NaN"), "{text}");
        }
    }
}
