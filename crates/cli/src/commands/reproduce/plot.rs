//! Error against step size as a self-contained SVG picture.

use std::fmt::Write;

use super::Series;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 480.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 170.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 50.0;
/// Colours that the colour-blind can tell apart (Okabe and Ito), one for each series.
const COLOURS: [&str; 5] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000"];

/// A logarithmic axis: values from `low` to `high`, drawn from `start` to `end`.
struct Axis {
    low: f64,
    high: f64,
    start: f64,
    end: f64,
}

impl Axis {
    /// An axis that holds all values, with some room around them.
    fn around(values: impl Iterator<Item = f64> + Clone, start: f64, end: f64) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(0.0, f64::max);
        Self { low: low / 1.4, high: high * 1.4, start, end }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (value / self.low).ln() / (self.high / self.low).ln();
        self.start + share * (self.end - self.start)
    }

    /// Powers of ten, or where these are too few also their double and fivefold.
    fn ticks(&self) -> Vec<f64> {
        let powers = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let within = |tick: &f64| (self.low..=self.high).contains(tick);
        let decades: Vec<f64> = powers.clone().map(|n| 10_f64.powi(n)).filter(within).collect();
        if decades.len() > 2 {
            return decades;
        }
        powers.flat_map(|n| [1.0, 2.0, 5.0].map(|m| m * 10_f64.powi(n))).filter(within).collect()
    }
}

/// The largest displacement error of every series over `h` or `dt`, with lines of slope 1 and 2.
pub(super) fn svg(title: &str, axis: &str, series: &[Series]) -> String {
    let points: Vec<Vec<(f64, f64)>> = series.iter().map(|one| reached(one, axis)).collect();
    let all = points.iter().flatten();
    if all.clone().next().is_none() {
        // Nothing to draw is still a picture.
        return frame(title, axis, "");
    }
    let x = Axis::around(all.clone().map(|p| p.0), LEFT, WIDTH - RIGHT);
    let y = Axis::around(all.map(|p| p.1), HEIGHT - BOTTOM, TOP);
    let mut body = String::new();
    grid(&mut body, &x, &y);
    slopes(&mut body, &x, &y, &points);
    for (index, (one, points)) in series.iter().zip(&points).enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let path: Vec<_> =
            points.iter().map(|p| format!("{:.1},{:.1}", x.at(p.0), y.at(p.1))).collect();
        let _ = writeln!(
            body,
            r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="1.6"/>"#,
            path.join(" ")
        );
        for point in points {
            marker(&mut body, index, colour, x.at(point.0), y.at(point.1));
        }
        let line = TOP + 14.0 + 34.0 * index as f64;
        marker(&mut body, index, colour, WIDTH - RIGHT + 18.0, line - 4.0);
        let fit = one.study.orders.u.linf.fit;
        let fit = fit.map_or_else(|| "no order".into(), |fit| format!("fit {fit:.2}"));
        let _ = writeln!(
            body,
            r##"<text x="{:.1}" y="{line:.1}">{}</text><text x="{:.1}" y="{:.1}" fill="#555">{fit}</text>"##,
            WIDTH - RIGHT + 30.0,
            one.name(),
            WIDTH - RIGHT + 30.0,
            line + 14.0
        );
    }
    frame(title, axis, &body)
}

/// Step and error of the cases that reached their end.
fn reached(one: &Series, axis: &str) -> Vec<(f64, f64)> {
    let rows = one.study.rows.iter().enumerate();
    rows.filter_map(|(index, row)| {
        let step = if axis == "h" { row.h } else { row.dt };
        one.error(index).filter(|error| *error > 0.0).map(|error| (step, error))
    })
    .collect()
}

fn frame(title: &str, axis: &str, body: &str) -> String {
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">
<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>
{body}<rect x="{LEFT}" y="{TOP}" width="{}" height="{}" fill="none" stroke="#333"/>
<text x="{LEFT}" y="22" font-size="14">{title}</text>
<text x="{}" y="{}" text-anchor="middle">{axis}</text>
<text transform="translate(16 {}) rotate(-90)" text-anchor="middle">L_inf error of u</text>
</svg>
"##,
        right - LEFT,
        bottom - TOP,
        (LEFT + right) / 2.0,
        HEIGHT - 12.0,
        (TOP + bottom) / 2.0
    )
}

fn grid(body: &mut String, x: &Axis, y: &Axis) {
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    for tick in x.ticks() {
        let at = x.at(tick);
        let _ = writeln!(
            body,
            r##"<line x1="{at:.1}" y1="{TOP}" x2="{at:.1}" y2="{bottom}" stroke="#ddd"/><text x="{at:.1}" y="{:.1}" text-anchor="middle">{tick:e}</text>"##,
            bottom + 16.0
        );
    }
    for tick in y.ticks() {
        let at = y.at(tick);
        let _ = writeln!(
            body,
            r##"<line x1="{LEFT}" y1="{at:.1}" x2="{right}" y2="{at:.1}" stroke="#ddd"/><text x="{:.1}" y="{:.1}" text-anchor="end">{tick:e}</text>"##,
            LEFT - 6.0,
            at + 4.0
        );
    }
}

/// Dashed lines of slope 1 and 2 through the finest point of the first series, moved below it.
fn slopes(body: &mut String, x: &Axis, y: &Axis, points: &[Vec<(f64, f64)>]) {
    let Some(&(step, error)) =
        points.first().and_then(|points| points.iter().min_by(|a, b| a.0.total_cmp(&b.0)))
    else {
        return;
    };
    for order in [1, 2] {
        let base = error / 1.25;
        // As far as the frame lets it go.
        let far = (x.high / step).min((y.high / base).powf(1.0 / f64::from(order)));
        let (end, height) = (step * far, base * far.powi(order));
        let _ = writeln!(
            body,
            r##"<line x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}" stroke="#777" stroke-dasharray="5 4"/><text x="{:.1}" y="{:.1}" fill="#555" text-anchor="end">{order}</text>"##,
            x.at(step),
            y.at(base),
            x.at(end),
            y.at(height),
            x.at(end) - 4.0,
            y.at(height) + 14.0
        );
    }
}

/// A marker of its own shape for each series, so that the picture can be printed in black.
fn marker(body: &mut String, index: usize, colour: &str, x: f64, y: f64) {
    let shape = match index % 5 {
        0 => format!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="4" fill="{colour}"/>"#),
        1 => format!(
            r#"<rect x="{:.1}" y="{:.1}" width="8" height="8" fill="{colour}"/>"#,
            x - 4.0,
            y - 4.0
        ),
        2 => format!(r#"<path d="M{x:.1} {:.1}l5 9h-10z" fill="{colour}"/>"#, y - 5.0),
        3 => format!(r#"<path d="M{x:.1} {:.1}l5 5l-5 5l-5 -5z" fill="{colour}"/>"#, y - 5.0),
        _ => format!(
            r#"<path d="M{:.1} {:.1}l8 8m0 -8l-8 8" stroke="{colour}" stroke-width="2"/>"#,
            x - 4.0,
            y - 4.0
        ),
    };
    body.push_str(&shape);
    body.push('\n');
}
