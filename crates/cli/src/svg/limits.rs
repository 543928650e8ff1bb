//! Limits of stability: a line over one setting, a map over two.

use std::fmt::Write;

use super::{escape, open};

const LEFT: f64 = 72.0;
const TOP: f64 = 56.0;
/// The least width and the height of a map's cell.
const CELL: (f64, f64) = (62.0, 38.0);
/// The first line of a map, below its words.
const MAP: f64 = 76.0;
/// Height of the line's frame.
const HEIGHT: f64 = 300.0;
const BOTTOM: f64 = TOP + HEIGHT;
/// Eight steps of the map viridis from dark to light, which keep their order in black and white.
const COLOURS: [&str; 8] =
    ["#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725"];
/// Below this a colour is dark, and text on it white.
const LIGHT: usize = 4;

/// A heat map. The values come with the second setting changing fastest.
pub(crate) struct Map<'a> {
    pub(crate) title: &'a str,
    pub(crate) x: (&'a str, &'a [String]),
    pub(crate) y: (&'a str, &'a [String]),
    pub(crate) values: &'a [Option<f64>],
    /// The limit of P-waves at each place.
    pub(crate) analytic: &'a [f64],
}

impl Map<'_> {
    pub(crate) fn svg(&self) -> String {
        let (columns, lines) = (self.x.1.len(), self.y.1.len());
        let across = self.across();
        let width = LEFT + across * columns as f64 + 16.0;
        let bottom = MAP + CELL.1 * lines as f64;
        let known = || self.values.iter().copied().flatten();
        let (low, high) =
            (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
        let range = match known().next() {
            None => "no limit was found anywhere".to_owned(),
            Some(_) => format!("limits from {low:.3} to {high:.3}"),
        };
        let description = format!(
            "{range} over {} and {}; a lighter cell is a larger limit, a dash none found. \
             The heavy line divides limits above and below 0.8 of the CFL number of P-waves.",
            self.x.0, self.y.0
        );
        let mut text = open("map", width, bottom + 64.0, self.title, &description);
        let _ = writeln!(
            text,
            r##"<text x="16" y="22" font-size="15" font-weight="bold">{}</text>
<text x="16" y="44" font-size="13">{range}; below each: its share of P-waves' limit</text>
<text x="16" y="62" font-size="13">Heavy line: between shares above and below 0.8. Lighter: larger.</text>"##,
            escape(self.title)
        );
        let at = |column: usize, line: usize| {
            (LEFT + across * column as f64, bottom - CELL.1 * (line + 1) as f64)
        };
        for column in 0..columns {
            for line in 0..lines {
                let index = column * lines + line;
                let (x, y) = at(column, line);
                let (colour, ink, first, second) = match self.values[index] {
                    None => ("#ffffff", "#111", "-".to_owned(), String::new()),
                    Some(value) => {
                        let share = if high > low { (value - low) / (high - low) } else { 1.0 };
                        let last = COLOURS.len() - 1;
                        let step = ((share * COLOURS.len() as f64) as usize).min(last);
                        let ink = if step < LIGHT { "#fff" } else { "#111" };
                        let analytic = value / self.analytic[index];
                        (COLOURS[step], ink, format!("{value:.3}"), format!("{analytic:.2}"))
                    }
                };
                let middle = x + across / 2.0;
                let _ = writeln!(
                    text,
                    r##"<g class="cell" data-name="{}" data-colour="{colour}"><rect x="{x}" y="{y}" width="{}" height="{}" fill="{colour}" stroke="#fff"/><text x="{middle}" y="{}" text-anchor="middle" font-size="13" fill="{ink}">{first}</text><text x="{middle}" y="{}" text-anchor="middle" font-size="13" fill="{ink}">{second}</text></g>"##,
                    escape(&format!("{}, {}", self.x.1[column], self.y.1[line])),
                    across,
                    CELL.1,
                    y + 17.0,
                    y + 33.0
                );
            }
        }
        self.divide(&mut text, at);
        for (column, value) in self.x.1.iter().enumerate() {
            let (x, _) = at(column, 0);
            let _ = writeln!(
                text,
                r##"<text x="{}" y="{}" text-anchor="middle" font-size="13">{}</text>"##,
                x + across / 2.0,
                bottom + 19.0,
                escape(value)
            );
        }
        for (line, value) in self.y.1.iter().enumerate() {
            let (_, y) = at(0, line);
            let _ = writeln!(
                text,
                r##"<text x="{}" y="{}" text-anchor="end" font-size="13">{}</text>"##,
                LEFT - 6.0,
                y + CELL.1 / 2.0 + 4.0,
                escape(value)
            );
        }
        let _ = writeln!(
            text,
            r##"<text x="{}" y="{}" text-anchor="middle">{}</text>
<text transform="translate(16 {}) rotate(-90)" text-anchor="middle">{}</text>
</svg>"##,
            LEFT + across * columns as f64 / 2.0,
            bottom + 44.0,
            escape(self.x.0),
            (MAP + bottom) / 2.0,
            escape(self.y.0)
        );
        text
    }

    /// The width of a cell: the picture has at least the width of the others.
    fn across(&self) -> f64 {
        ((480.0 - LEFT - 16.0) / self.x.1.len() as f64).max(CELL.0)
    }

    /// The line between cells whose limit is above, and those whose limit is below, 0.8 of P-waves'.
    fn divide(&self, text: &mut String, at: impl Fn(usize, usize) -> (f64, f64)) {
        let across = self.across();
        let (columns, lines) = (self.x.1.len(), self.y.1.len());
        let above = |column: usize, line: usize| {
            let index = column * lines + line;
            self.values[index].map(|value| value >= 0.8 * self.analytic[index])
        };
        let differ = |a: Option<bool>, b: Option<bool>| a.zip(b).is_some_and(|(a, b)| a != b);
        let mut path = String::new();
        for column in 0..columns {
            for line in 0..lines {
                let (x, y) = at(column, line);
                if column + 1 < columns && differ(above(column, line), above(column + 1, line)) {
                    let _ = write!(path, "M{} {y}v{}", x + across, CELL.1);
                }
                if line + 1 < lines && differ(above(column, line), above(column, line + 1)) {
                    let _ = write!(path, "M{x} {y}h{}", across);
                }
            }
        }
        if !path.is_empty() {
            let _ = writeln!(
                text,
                r##"<path class="division" d="{path}" stroke="#000" stroke-width="3" fill="none"/>"##
            );
        }
    }
}

/// A line, its places evenly spread, whatever the values are.
pub(crate) struct Limits<'a> {
    pub(crate) title: &'a str,
    pub(crate) x: &'a str,
    pub(crate) values: &'a [String],
    pub(crate) measured: &'a [Option<f64>],
    /// The limit of P-waves at each place.
    pub(crate) analytic: &'a [f64],
}

impl Limits<'_> {
    pub(crate) fn svg(&self) -> String {
        let count = self.values.len();
        let right = (LEFT + CELL.0 * count as f64 + 16.0).max(480.0) - 16.0;
        let all = self.measured.iter().copied().flatten().chain(self.analytic.iter().copied());
        let frame = Frame { count, right, high: all.fold(0.0_f64, f64::max) * 1.1 };
        let told: Vec<_> = self
            .values
            .iter()
            .zip(self.measured)
            .map(|(value, limit)| match limit {
                Some(limit) => format!("{value}: {limit:.3}"),
                None => format!("{value}: none found"),
            })
            .collect();
        let description = format!("Limits over {}: {}.", self.x, told.join("; "));
        let mut text = open("limits", right + 16.0, BOTTOM + 112.0, self.title, &description);
        let _ = writeln!(
            text,
            r##"<text x="16" y="22" font-size="15" font-weight="bold">{}</text>"##,
            escape(self.title)
        );
        self.axes(&frame, &mut text);
        let line: Vec<_> = self
            .analytic
            .iter()
            .enumerate()
            .map(|(place, value)| format!("{:.1},{:.1}", frame.x(place), frame.y(*value)))
            .collect();
        let _ = writeln!(
            text,
            r##"<polyline class="analytic" points="{}" fill="none" stroke="#d55e00" stroke-width="2" stroke-dasharray="7 3"/>"##,
            line.join(" ")
        );
        self.points(&frame, &mut text);
        self.legend(&frame, &mut text);
        text
    }

    fn axes(&self, frame: &Frame, text: &mut String) {
        let &Frame { right, high, .. } = frame;
        let step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0]
            .into_iter()
            .find(|step| high / step <= 8.0)
            .unwrap_or(high);
        for tick in 0..=(high / step) as usize {
            let value = tick as f64 * step;
            let _ = writeln!(
                text,
                r##"<path d="M{LEFT} {at:.1}H{right}" stroke="#ddd"/><text x="{:.1}" y="{:.1}" text-anchor="end" font-size="13">{}</text>"##,
                LEFT - 6.0,
                frame.y(value) + 5.0,
                (value * 100.0).round() / 100.0,
                at = frame.y(value),
            );
        }
        for (place, value) in self.values.iter().enumerate() {
            let _ = writeln!(
                text,
                r##"<text x="{:.1}" y="{}" text-anchor="middle" font-size="13">{}</text>"##,
                frame.x(place),
                BOTTOM + 18.0,
                escape(value)
            );
        }
    }

    fn points(&self, frame: &Frame, text: &mut String) {
        let mut parts: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
        for (place, value) in self.measured.iter().enumerate() {
            match (value, parts.last_mut()) {
                (Some(value), Some(part)) => part.push((frame.x(place), frame.y(*value))),
                // The line has a gap where no limit was found.
                _ => parts.push(Vec::new()),
            }
        }
        // Between names there is nothing that a line could stand for.
        let is_numeric = self.values.iter().all(|value| value.parse::<f64>().is_ok());
        for part in parts.iter().filter(|part| !part.is_empty()) {
            let points: Vec<_> = part.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            if is_numeric {
                let _ = writeln!(
                    text,
                    r##"<polyline class="measured" points="{}" fill="none" stroke="#0072b2" stroke-width="2"/>"##,
                    points.join(" ")
                );
            }
            for (x, y) in part {
                let _ =
                    writeln!(text, r##"<circle cx="{x:.1}" cy="{y:.1}" r="5" fill="#0072b2"/>"##);
            }
        }
    }

    fn legend(&self, frame: &Frame, text: &mut String) {
        let right = frame.right;
        let (first, second) = (BOTTOM + 70.0, BOTTOM + 94.0);
        let _ = writeln!(
            text,
            r##"<rect x="{LEFT}" y="{TOP}" width="{}" height="{HEIGHT}" fill="none" stroke="#333"/>
<text x="{}" y="{}" text-anchor="middle">{}</text>
<text transform="translate(18 {}) rotate(-90)" text-anchor="middle">CFL number</text>
<path d="M{LEFT} {first}h44" stroke="#0072b2" stroke-width="2"/><circle cx="{}" cy="{first}" r="5" fill="#0072b2"/>
<text x="{}" y="{}">measured</text>
<path d="M{LEFT} {second}h44" stroke="#d55e00" stroke-width="2" stroke-dasharray="7 3"/>
<text x="{}" y="{}">P-waves cross one cell in one step</text>
</svg>"##,
            right - LEFT,
            (LEFT + right) / 2.0,
            BOTTOM + 42.0,
            escape(self.x),
            (TOP + BOTTOM) / 2.0,
            LEFT + 22.0,
            LEFT + 54.0,
            first + 5.0,
            LEFT + 54.0,
            second + 5.0
        );
    }
}

/// Places and numbers of a line on the picture.
struct Frame {
    count: usize,
    right: f64,
    high: f64,
}

impl Frame {
    fn x(&self, place: usize) -> f64 {
        LEFT + (self.right - LEFT) * (place as f64 + 0.5) / self.count as f64
    }

    fn y(&self, value: f64) -> f64 {
        BOTTOM - HEIGHT * value / self.high
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(values: &[&str]) -> Vec<String> {
        values.iter().map(|value| (*value).to_owned()).collect()
    }

    #[test]
    fn a_map_has_a_cell_for_each_pair_and_a_line_where_the_share_changes() {
        let (columns, lines) = (words(&["1e-8", "0.1"]), words(&["0", "<0.3", "0.49"]));
        let values = [Some(0.9), Some(0.8), None, Some(0.7), Some(0.7), Some(0.2)];
        let map = Map {
            title: "a < b",
            x: ("amplitude", &columns),
            y: ("nu", &lines),
            values: &values,
            analytic: &[1.0, 0.9, 0.25, 1.0, 0.9, 0.25],
        };
        let text = map.svg();
        assert_eq!(text.matches("class=\"cell\"").count(), 6);
        assert!(text.contains(">0.900<") && text.contains(">-<") && text.contains("&lt;0.3"));
        // Shares: 0.9, 0.89, none; 0.7, 0.78, 0.8. Between columns two lines, in the second column one.
        let path = text.split("class=\"division\" d=\"").nth(1).and_then(|t| t.split('"').next());
        let path = path.expect("a dividing line");
        assert_eq!((path.matches('v').count(), path.matches('h').count()), (2, 1), "{path}");
    }

    #[test]
    fn a_line_has_a_gap_where_no_limit_was_found() {
        let values = words(&["1", "2", "3", "4"]);
        let measured = [Some(0.9), None, Some(0.7), Some(0.5)];
        let analytic = [1.0, 1.0, 1.0, 0.5];
        let text = Limits {
            title: "t",
            x: "nu",
            values: &values,
            measured: &measured,
            analytic: &analytic,
        }
        .svg();
        assert_eq!(text.matches("class=\"measured\"").count(), 2);
        assert_eq!(text.matches("<circle").count(), 3 + 1);
        assert!(text.contains("2: none found"), "{text}");
    }
}
