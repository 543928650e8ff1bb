//! Error against step size, both logarithmic.

use std::fmt::Write;

use super::{escape, number, open};
use crate::terminal;

pub(super) const WIDTH: f64 = 480.0;
pub(super) const LEFT: f64 = 72.0;
pub(super) const RIGHT: f64 = 466.0;
pub(super) const TOP: f64 = 38.0;
pub(super) const BOTTOM: f64 = 370.0;
/// Where the legend starts, and how far apart its lines are.
pub(super) const LEGEND: f64 = 432.0;
pub(super) const LINE: f64 = 22.0;
/// Colours that the colour-blind can tell apart (Okabe and Ito), and the dashes that go with them.
const STYLES: [(&str, &str); 6] = [
    ("#0072b2", ""),
    ("#d55e00", "7 3"),
    ("#009e73", "2 3"),
    ("#a0457a", "8 3 2 3"),
    ("#000000", "4 2"),
    ("#8a6d00", "1 2"),
];
/// The colour and the dashes of curve `index`. Shapes of markers repeat after as many as there are colours, then with another
/// colour.
pub(super) fn style(index: usize) -> (&'static str, &'static str) {
    let count = STYLES.len();
    (STYLES[(index + index / count) % count].0, STYLES[index % count].1)
}

/// Room for a triangle below the lowest curve, with its number.
const TRIANGLE: f64 = 20.0;
/// The height of a line of a note, and the characters that it has room for.
const NOTE: f64 = 17.0;
const NOTE_LENGTH: usize = 62;
/// Errors within this factor of the round-off floor are near it.
const NEAR: f64 = 100.0;

/// Curves of error against step.
pub(crate) struct Plot<'a> {
    pub(crate) title: &'a str,
    /// The name of the step, with its unit.
    pub(crate) x: &'a str,
    /// The name of the error, with its unit.
    pub(crate) y: &'a str,
    pub(crate) curves: Vec<Curve>,
    /// Words below the legend, in as many lines as they need; none where it is empty.
    pub(crate) note: &'a str,
    /// Slopes to draw for comparison.
    pub(crate) orders: &'a [i32],
    /// The error that rounding alone may cause.
    pub(crate) floor: Option<f64>,
}

/// One series of errors.
pub(crate) struct Curve {
    pub(crate) name: String,
    /// Step and error of each case that has one.
    pub(crate) points: Vec<(f64, f64)>,
    /// Cases without an error.
    pub(crate) stopped: usize,
    /// The fitted slope.
    pub(crate) fit: Option<f64>,
    /// The order that a triangle beside the curve shows.
    order: Option<i32>,
}

impl Curve {
    /// The curve of the steps that have an error.
    pub(crate) fn new(
        name: impl Into<String>,
        cases: impl IntoIterator<Item = (f64, Option<f64>)>,
        fit: Option<f64>,
    ) -> Self {
        let mut curve =
            Self { name: name.into(), points: Vec::new(), stopped: 0, fit, order: None };
        for (step, error) in cases {
            match error {
                Some(error) if error > 0.0 && error.is_finite() => curve.points.push((step, error)),
                // No logarithm, yet not stopped either.
                Some(0.0) => {}
                _ => curve.stopped += 1,
            }
        }
        curve
    }

    /// This curve with a triangle that shows an order.
    pub(crate) fn with_triangle(self, order: i32) -> Self {
        Self { order: Some(order), ..self }
    }

    /// The curve's words in the legend.
    fn label(&self) -> String {
        let fit = self.fit.map_or_else(|| "no slope".to_owned(), |fit| format!("slope {fit:.2}"));
        match (self.points.len(), self.stopped) {
            (0, 0) => format!("{}: all zero", self.name),
            (0, _) => format!("{}: all runs stopped", self.name),
            (_, 0) => format!("{}: {fit}", self.name),
            (_, stopped) => format!("{}: {fit}, {stopped} stopped", self.name),
        }
    }
}

/// A logarithmic axis: values from `low` to `high`, drawn from `start` to `end`.
pub(super) struct Axis {
    low: f64,
    high: f64,
    start: f64,
    end: f64,
}

impl Axis {
    /// An axis that holds all values, with room around them for their markers.
    pub(super) fn around(values: impl Iterator<Item = f64> + Clone, start: f64, end: f64) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(0.0, f64::max);
        let room = (high / low).powf(0.04).clamp(1.5, 100.0);
        Self { low: low / room, high: high * room, start, end }
    }

    /// Moves the lower end so that this length below what was there is free.
    fn make_room_below(&mut self, length: f64) {
        let whole = (self.end - self.start).abs();
        self.low = self.high * (self.low / self.high).powf(whole / (whole - length));
    }

    pub(super) fn at(&self, value: f64) -> f64 {
        let share = (value / self.low).ln() / (self.high / self.low).ln();
        self.start + share * (self.end - self.start)
    }

    /// Powers of ten, thinned out where there are many, and where they are few also their double and fivefold.
    fn ticks(&self) -> Vec<f64> {
        let powers = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let within = |tick: &f64| (self.low..=self.high).contains(tick);
        let power = |n: i32| format!("1e{n}").parse().unwrap_or(f64::NAN);
        let decades: Vec<f64> = powers.clone().map(power).filter(within).collect();
        if decades.len() > 2 {
            return decades.iter().copied().step_by(decades.len().div_ceil(8)).collect();
        }
        let multiples =
            powers.flat_map(|n| [1, 2, 5].map(|m| format!("{m}e{n}").parse().unwrap_or(f64::NAN)));
        multiples.filter(within).collect()
    }
}

impl Plot<'_> {
    /// The height of the picture.
    pub(crate) fn height(&self) -> f64 {
        let lines = self.curves.len() + usize::from(self.floor.is_some());
        LEGEND + LINE * lines as f64 + NOTE * self.note().len() as f64
    }

    fn note(&self) -> Vec<String> {
        let lines = terminal::wrapped(self.note, NOTE_LENGTH);
        lines.into_iter().filter(|line| !line.is_empty()).collect()
    }

    pub(crate) fn svg(&self) -> String {
        let height = self.height();
        let labels: Vec<_> = self.curves.iter().map(Curve::label).collect();
        let mut text = open("plot", WIDTH, height, self.title, &format!("{}.", labels.join("; ")));
        let _ = writeln!(
            text,
            r##"<text x="{LEFT}" y="22" font-size="15" font-weight="bold">{}</text>"##,
            escape(self.title)
        );
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        if points.clone().next().is_some() {
            let x = Axis::around(points.clone().map(|p| p.0), LEFT, RIGHT);
            let least = points.clone().map(|p| p.1).fold(f64::INFINITY, f64::min);
            let mut y = Axis::around(points.map(|p| p.1), BOTTOM, TOP);
            let floor = self.floor.filter(|floor| least < NEAR * floor);
            if let Some(floor) = floor {
                y.low = y.low.min(floor / 3.0);
            }
            if self.curves.iter().any(|curve| curve.order.is_some()) {
                y.make_room_below(TRIANGLE);
            }
            grid(&mut text, &x, &y);
            if let Some(floor) = floor {
                let at = y.at(floor).max(TOP);
                let _ = writeln!(
                    text,
                    r##"<rect class="floor" x="{LEFT}" y="{at:.1}" width="{:.1}" height="{:.1}" fill="#bbb" fill-opacity="0.5"/><text x="{:.1}" y="{:.1}" text-anchor="end">round-off</text>"##,
                    RIGHT - LEFT,
                    BOTTOM - at,
                    RIGHT - 6.0,
                    at + 16.0
                );
            }
            self.slopes(&mut text, &x, &y);
            for (index, curve) in self.curves.iter().enumerate() {
                draw(&mut text, index, curve, &x, &y);
                triangle(&mut text, index, curve, &x, &y);
            }
        }
        frame(&mut text, self.x, self.y);
        for (index, label) in labels.iter().enumerate() {
            let (colour, dash) = style(index);
            let line = LEGEND + LINE * index as f64;
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
                escape(label)
            );
        }
        if let Some(floor) = self.floor {
            let line = LEGEND + LINE * self.curves.len() as f64;
            let _ = writeln!(
                text,
                r##"<text x="{}" y="{}" fill="#444">round-off floor about {floor:.1e}</text>"##,
                LEFT + 54.0,
                line + 5.0
            );
        }
        let note = self.note();
        for (index, line) in note.iter().enumerate() {
            let _ = writeln!(
                text,
                r##"<text x="{LEFT}" y="{:.1}" font-size="12" fill="#444">{}</text>"##,
                height - NOTE * (note.len() - index) as f64 - 2.0,
                escape(line)
            );
        }
        text.push_str("</svg>\n");
        text
    }

    /// Dashed lines through the finest point of the first curve that has one, moved below it.
    fn slopes(&self, text: &mut String, x: &Axis, y: &Axis) {
        let first = self.curves.iter().find(|curve| !curve.points.is_empty());
        let finest = first.and_then(|c| c.points.iter().min_by(|a, b| a.0.total_cmp(&b.0)));
        let Some(&(step, error)) = finest else { return };
        for &order in self.orders {
            let base = (error / 1.25).max(y.low);
            // As far as the frame lets it go.
            let far = (x.high / step).min((y.high / base).powf(1.0 / f64::from(order)));
            let (x1, y1) = (x.at(step), y.at(base));
            let (x2, y2) = (x.at(step * far), y.at(base * far.powi(order)));
            // The order is written below the line, near its upper end.
            let (xt, yt) = (x1 + (x2 - x1) * 0.85 + 10.0, y1 + (y2 - y1) * 0.85 + 16.0);
            let _ = writeln!(
                text,
                r##"<path d="M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}" stroke="#777" stroke-dasharray="6 4"/><text x="{xt:.1}" y="{yt:.1}" fill="#444" text-anchor="middle">{order}</text>"##
            );
        }
    }
}

/// The frame of a plot, with what its axes are.
pub(super) fn frame(text: &mut String, x: &str, y: &str) {
    let (width, height) = (RIGHT - LEFT, BOTTOM - TOP);
    let _ = writeln!(
        text,
        r##"<rect x="{LEFT}" y="{TOP}" width="{width}" height="{height}" fill="none" stroke="#333"/>
<text x="{}" y="{}" text-anchor="middle">{}</text>
<text transform="translate(18 {}) rotate(-90)" text-anchor="middle">{}</text>"##,
        (LEFT + RIGHT) / 2.0,
        BOTTOM + 40.0,
        escape(x),
        (TOP + BOTTOM) / 2.0,
        escape(y)
    );
}

/// The lines of a plot's grid, with their values.
pub(super) fn grid(text: &mut String, x: &Axis, y: &Axis) {
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
        let at = y.at(tick);
        let _ = writeln!(
            text,
            r##"<path d="M{LEFT} {at:.1}H{RIGHT}" stroke="#ddd"/><text x="{:.1}" y="{:.1}" text-anchor="end" font-size="13">{}</text>"##,
            LEFT - 6.0,
            at + 5.0,
            number(tick)
        );
    }
}

fn draw(text: &mut String, index: usize, curve: &Curve, x: &Axis, y: &Axis) {
    if curve.points.is_empty() {
        return;
    }
    let (colour, dash) = style(index);
    let places: Vec<_> =
        curve.points.iter().map(|p| format!("{:.1},{:.1}", x.at(p.0), y.at(p.1))).collect();
    let _ = writeln!(
        text,
        r##"<g class="curve" data-name="{}" data-colour="{colour}"><polyline points="{}" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"/>"##,
        escape(&curve.name),
        places.join(" ")
    );
    for point in &curve.points {
        marker(text, index, x.at(point.0), y.at(point.1));
    }
    text.push_str("</g>\n");
}

/// A triangle below the two smallest steps of a curve, which shows its slope where it has this order.
fn triangle(text: &mut String, index: usize, curve: &Curve, x: &Axis, y: &Axis) {
    /// Room between the curve and the triangle.
    const DOWN: f64 = 12.0;
    const SIZE: f64 = 13.0;
    let Some(order) = curve.order else { return };
    let mut points = curve.points.clone();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [first, second, ..] = points[..] else { return };
    let (colour, _) = style(index);
    let rise = y.at(first.1 * (second.0 / first.0).powi(order)) - y.at(first.1);
    let (left, right) = (x.at(first.0), x.at(second.0));
    // Neither end of its slope above the curve.
    let bottom = y.at(first.1).max(y.at(second.1) - rise) + DOWN;
    let _ = writeln!(
        text,
        r##"<path class="order" d="M{left:.1} {bottom:.1}H{right:.1}v{rise:.1}z" fill="{colour}" fill-opacity="0.12" stroke="{colour}"/>
<text x="{:.1}" y="{:.1}" text-anchor="middle" font-size="{SIZE}">1</text><text x="{:.1}" y="{:.1}" font-size="{SIZE}">{order}</text>"##,
        (left + right) / 2.0,
        bottom + SIZE,
        right + 5.0,
        bottom + rise / 2.0 + 4.5
    );
}

/// A marker of its own shape and fill for each curve, so that the picture can be printed in black.
pub(super) fn marker(text: &mut String, index: usize, x: f64, y: f64) {
    let (colour, _) = style(index);
    let (path, filled) = match index % STYLES.len() {
        0 => (format!("M{:.1} {y:.1}a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z", x - 5.0), true),
        1 => (format!("M{:.1} {:.1}h9v9h-9z", x - 4.5, y - 4.5), false),
        2 => (format!("M{x:.1} {:.1}l6 10h-12z", y - 6.0), true),
        3 => (format!("M{x:.1} {:.1}l6 6l-6 6l-6 -6z", y - 6.0), false),
        4 => (format!("M{:.1} {:.1}l9 9m0 -9l-9 9", x - 4.5, y - 4.5), false),
        _ => (format!("M{x:.1} {:.1}l6 -10h-12z", y + 6.0), false),
    };
    let fill = if filled { colour } else { "#fff" };
    let _ =
        writeln!(text, r##"<path d="{path}" fill="{fill}" stroke="{colour}" stroke-width="2"/>"##);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(curves: Vec<Curve>, floor: Option<f64>) -> String {
        Plot { title: "a < b", x: "h", y: "error", curves, note: "", orders: &[1, 2], floor }.svg()
    }

    #[test]
    fn a_power_law_is_a_straight_line_at_its_slope() {
        let curve = Curve::new("c", [0.1, 0.01, 0.001].map(|h: f64| (h, Some(h * h))), Some(2.0));
        let text = plot(vec![curve], None);
        let points = text.split("points=\"").nth(1).and_then(|rest| rest.split('"').next());
        let places: Vec<Vec<f64>> = points
            .into_iter()
            .flat_map(|points| points.split(' '))
            .map(|p| p.split(',').map(|n| n.parse().expect("a number")).collect())
            .collect();
        assert_eq!(places.len(), 3);
        let slope =
            |a: usize, b: usize| (places[b][1] - places[a][1]) / (places[b][0] - places[a][0]);
        assert!((slope(0, 1) - slope(1, 2)).abs() < 0.01, "{places:?}");
        assert!(text.contains("c: slope 2.00") && text.contains("a &lt; b"));
    }

    #[test]
    fn stopped_runs_are_told_and_nothing_to_draw_is_still_a_picture() {
        let curve = |cases| Curve::new("mpm", cases, None);
        let text = plot(vec![curve([(0.1, Some(1.0)), (0.2, None)])], None);
        assert!(text.contains("mpm: no slope, 1 stopped"));
        let text = plot(vec![curve([(0.1, None), (0.2, Some(f64::NAN))])], None);
        assert!(text.contains("mpm: all runs stopped") && text.ends_with("</svg>\n"));
        assert!(!text.contains("class=\"curve\""));
    }

    #[test]
    fn the_round_off_floor_is_shaded_only_near_it() {
        let curve =
            |error| vec![Curve::new("c", [(0.1, Some(error)), (0.2, Some(2.0 * error))], None)];
        assert!(plot(curve(1e-14), Some(1e-15)).contains("class=\"floor\""));
        assert!(!plot(curve(1e-4), Some(1e-15)).contains("class=\"floor\""));
    }

    #[test]
    fn a_triangle_shows_its_order_on_the_axes_of_the_plot() {
        let cases = [0.1, 0.05, 0.025].map(|h: f64| (h, Some(h.powi(3))));
        let text = plot(vec![Curve::new("c", cases, Some(3.0)).with_triangle(3)], None);
        let line = text.lines().find(|line| line.contains("class=\"order\"")).expect("a triangle");
        let path =
            line.split(" d=\"").nth(1).and_then(|rest| rest.split('z').next()).expect("a path");
        let numbers: Vec<f64> = path
            .split(|c: char| !(c.is_ascii_digit() || c == '-' || c == '.'))
            .filter_map(|number| number.parse().ok())
            .collect();
        let [left, _, right, rise] = numbers[..] else { panic!("{path}") };
        let points = text.split("points=\"").nth(1).and_then(|rest| rest.split('"').next());
        let places: Vec<f64> = points
            .into_iter()
            .flat_map(|points| points.split([' ', ',']))
            .filter_map(|number| number.parse().ok())
            .collect();
        // Its number lies within the frame too.
        let bottom = numbers[1] + 14.0;
        assert!(bottom < BOTTOM, "{bottom}");
        // The curve has the order of the triangle: its two finest points differ as the triangle's ends do.
        let [_, _, coarse_x, coarse_y, fine_x, fine_y] = places[..] else { panic!("{places:?}") };
        assert!((left - fine_x).abs() < 0.2 && (right - coarse_x).abs() < 0.2, "{text}");
        assert!((rise - (coarse_y - fine_y)).abs() < 0.3, "{text}");
        assert!(
            !plot(vec![Curve::new("c", [(0.1, Some(1.0))], None).with_triangle(1)], None)
                .contains("class=\"order\"")
        );
    }

    #[test]
    fn every_curve_has_a_marker_of_its_own() {
        let markers: Vec<_> = (0..STYLES.len() * STYLES.len())
            .map(|index| {
                let mut text = String::new();
                marker(&mut text, index, 0.0, 0.0);
                text
            })
            .collect();
        for (index, one) in markers.iter().enumerate() {
            assert!(!markers[..index].contains(one), "{one:?}");
        }
    }
}
