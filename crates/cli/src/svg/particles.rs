//! Particles in the plane, coloured by a value.

use std::fmt::Write;

use super::{escape, number, open, round_values, rounded};
use crate::terminal;

const WIDTH: f64 = 480.0;
const LEFT: f64 = 62.0;
const TOP: f64 = 38.0;
/// The largest extent of the frame.
const SIDE: f64 = 332.0;
/// The least height of the frame: that of a body in one dimension.
const LOW: f64 = 90.0;
/// Room between the particles and the frame.
const ROOM: f64 = 12.0;
/// Below the frame: values and the name of the axis.
const BELOW: f64 = 54.0;
/// Below that: the lines of a note.
const NOTE: f64 = 17.0;
/// The colour bar.
const BAR: f64 = 406.0;
const BAR_WIDTH: f64 = 14.0;
/// Least distance of values along an axis.
const APART: f64 = 48.0;
/// Ten steps of the map viridis, whose lightness rises evenly, so that it reads the same in grey.
const COLOURS: [&str; 10] = [
    "#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58",
    "#b5de2b", "#fde725",
];
/// Behind the particles: yellow shows on it.
const GROUND: &str = "#d8d8d8";
/// Characters of a note that a line has room for.
const NOTE_LENGTH: usize = 66;

/// Particles with a value each.
pub(crate) struct Particles<'a> {
    pub(crate) title: &'a str,
    /// Positions in the plane.
    pub(crate) points: &'a [[f64; 2]],
    pub(crate) values: &'a [f64],
    /// Values of the two ends of the colour bar; beyond them the end's colour is used.
    pub(crate) range: (f64, f64),
    /// The unit of the values; empty where it is not known.
    pub(crate) unit: &'a str,
    /// The names of the axes, with the unit of lengths.
    pub(crate) axes: [&'a str; 2],
    /// Words below, in as many lines as they need; none where it is empty.
    pub(crate) note: &'a str,
}

/// How positions become places in the picture.
struct Place {
    scale: f64,
    low: [f64; 2],
    /// The place of the lower left particle.
    start: [f64; 2],
    /// The lower end of the frame.
    bottom: f64,
}

impl Place {
    fn of(points: &[[f64; 2]]) -> (Self, [f64; 2]) {
        let ends = [0, 1].map(|axis| extremes(points.iter().map(|point| point[axis])));
        let extent = ends.map(|(low, high)| if high > low { high - low } else { 0.0 });
        let longest = extent[0].max(extent[1]);
        let room = SIDE - 2.0 * ROOM;
        let scale = if longest > 0.0 { room / longest } else { 1.0 };
        let height = (scale * extent[1] + 2.0 * ROOM).max(LOW);
        let bottom = TOP + height;
        // In the middle of the frame.
        let start =
            [LEFT + (SIDE - scale * extent[0]) / 2.0, bottom - (height - scale * extent[1]) / 2.0];
        (Self { scale, low: ends.map(|(low, _)| low), start, bottom }, extent)
    }

    fn at(&self, point: [f64; 2]) -> [f64; 2] {
        [
            self.start[0] + self.scale * (point[0] - self.low[0]),
            self.start[1] - self.scale * (point[1] - self.low[1]),
        ]
    }

    /// Round positions along an axis, with their places.
    fn ticks(&self, axis: usize) -> Vec<(f64, f64)> {
        let length = [SIDE, self.bottom - TOP][axis];
        let before = [self.start[0] - LEFT, self.bottom - self.start[1]][axis];
        let low = self.low[axis] - before / self.scale;
        let most = (length / APART).max(1.0);
        let ticks = round_values(low, low + length / self.scale, most).into_iter();
        let place = |tick| {
            let mut point = self.low;
            point[axis] = tick;
            (tick, self.at(point)[axis])
        };
        ticks.map(place).collect()
    }
}

impl Particles<'_> {
    pub(crate) fn svg(&self) -> String {
        let (low, high) = self.range;
        let (least, most) = extremes(self.values.iter().copied());
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        let description = format!(
            "{} particles, values from {} to {}{unit}; lighter is larger.",
            self.points.len(),
            rounded(least, 4),
            rounded(most, 4),
        );
        let (place, extent) = Place::of(self.points);
        let note = terminal::wrapped(self.note, NOTE_LENGTH);
        let note: Vec<_> = note.iter().filter(|line| !line.is_empty()).collect();
        let height = place.bottom + BELOW + NOTE * note.len() as f64;
        let mut text = open("particles", WIDTH, height, self.title, &description);
        let _ = writeln!(
            text,
            r##"<text x="{LEFT}" y="22" font-size="15" font-weight="bold">{}</text>"##,
            escape(self.title)
        );
        self.axes(&mut text, &place);
        // As wide as the particles' share of the area, so that neighbours just touch; of the length in one dimension.
        let count = self.points.len() as f64;
        let share = match extent {
            [x, y] if x > 0.0 && y > 0.0 => (x * y / count).sqrt(),
            [x, y] => x.max(y) / count,
        };
        let width = (0.95 * place.scale * share).clamp(0.5, 20.0);
        let mut bands = vec![String::new(); COLOURS.len()];
        for (point, value) in self.points.iter().zip(self.values) {
            let share = if high > low { (value - low) / (high - low) } else { 0.0 };
            let band = (share * COLOURS.len() as f64).clamp(0.0, COLOURS.len() as f64 - 0.5);
            let [x, y] = place.at(*point);
            // A line of no length with round ends is a dot.
            let _ = write!(bands[band as usize], "M{x:.1} {y:.1}h0");
        }
        for (colour, dots) in COLOURS.iter().zip(&bands).filter(|(_, dots)| !dots.is_empty()) {
            let _ = writeln!(
                text,
                r##"<path class="dots" data-colour="{colour}" d="{dots}" stroke="{colour}" stroke-width="{width:.2}" stroke-linecap="round"/>"##
            );
        }
        self.bar(&mut text, &place);
        for (index, line) in note.iter().enumerate() {
            let _ = writeln!(
                text,
                r##"<text x="{}" y="{:.1}" text-anchor="middle" font-size="12">{}</text>"##,
                LEFT + SIDE / 2.0,
                place.bottom + BELOW + NOTE * index as f64 + 6.0,
                escape(line)
            );
        }
        text.push_str("</svg>\n");
        text
    }

    /// The frame, round positions along it, and what they are.
    fn axes(&self, text: &mut String, place: &Place) {
        let bottom = place.bottom;
        for (tick, x) in place.ticks(0) {
            let _ = writeln!(
                text,
                r##"<path d="M{x:.1} {bottom:.1}v5" stroke="#333"/><text x="{x:.1}" y="{:.1}" text-anchor="middle" font-size="13">{}</text>"##,
                bottom + 19.0,
                number(tick)
            );
        }
        for (tick, y) in place.ticks(1) {
            let _ = writeln!(
                text,
                r##"<path d="M{LEFT} {y:.1}h-5" stroke="#333"/><text x="{}" y="{:.1}" text-anchor="end" font-size="13">{}</text>"##,
                LEFT - 8.0,
                y + 4.5,
                number(tick)
            );
        }
        let _ = writeln!(
            text,
            r##"<rect class="frame" x="{LEFT}" y="{TOP}" width="{SIDE}" height="{:.1}" fill="{GROUND}" stroke="#333"/>
<text x="{}" y="{:.1}" text-anchor="middle">{}</text>
<text transform="translate(16 {:.1}) rotate(-90)" text-anchor="middle">{}</text>"##,
            bottom - TOP,
            LEFT + SIDE / 2.0,
            bottom + 42.0,
            escape(self.axes[0]),
            (TOP + bottom) / 2.0,
            escape(self.axes[1])
        );
    }

    /// The colours with their values.
    fn bar(&self, text: &mut String, place: &Place) {
        let (low, high) = self.range;
        let length = place.bottom - TOP;
        let step = length / COLOURS.len() as f64;
        for (index, colour) in COLOURS.iter().enumerate() {
            let y = place.bottom - step * (index + 1) as f64;
            let _ = writeln!(
                text,
                r##"<rect x="{BAR}" y="{y:.1}" width="{BAR_WIDTH}" height="{step:.1}" fill="{colour}"/>"##
            );
        }
        let ticks = if high > low { round_values(low, high, 8.0) } else { vec![low] };
        for tick in ticks {
            let share = if high > low { (tick - low) / (high - low) } else { 0.5 };
            let y = place.bottom - length * share;
            let _ = writeln!(
                text,
                r##"<path d="M{} {y:.1}h4" stroke="#333"/><text x="{}" y="{:.1}" font-size="13">{}</text>"##,
                BAR + BAR_WIDTH,
                BAR + BAR_WIDTH + 6.0,
                y + 4.5,
                rounded(tick, 3)
            );
        }
        let _ = writeln!(
            text,
            r##"<rect x="{BAR}" y="{TOP}" width="{BAR_WIDTH}" height="{length:.1}" fill="none" stroke="#333"/>
<text x="{}" y="22" text-anchor="end">{}</text>"##,
            WIDTH - 8.0,
            escape(self.unit)
        );
    }
}

/// The smallest and the largest of some values.
pub(crate) fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(points: &[[f64; 2]], values: &[f64], range: (f64, f64)) -> String {
        let axes = ["x [m]", "y [m]"];
        Particles { title: "t", points, values, range, unit: "Pa", axes, note: "" }.svg()
    }

    #[test]
    fn every_particle_is_a_dot_in_the_colour_of_its_value() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let text = picture(&points, &[0.0, 10.0, -5.0, 25.0], (0.0, 10.0));
        let dots = |colour| {
            let path = text.lines().find(|l| l.contains("dots") && l.contains(colour));
            path.map_or(0, |path| path.matches("h0").count())
        };
        assert_eq!((dots(COLOURS[0]), dots(COLOURS[9])), (2, 2));
    }

    #[test]
    fn axes_and_colour_bar_have_round_values_and_units() {
        let text = picture(&[[-0.5, 0.0], [1.0, 1.0]], &[1.0, 2000.0], (3.0, 2000.0));
        for told in ["x [m]", "y [m]", "Pa", "-0.5", "0", "0.5", "1", "500", "2000"] {
            assert!(text.contains(&format!(">{told}</text>")), "{told}: {text}");
        }
        // A tick is where a particle at its position is.
        let x = text.lines().find(|line| line.contains(">-0.5</text>"));
        let x = x.and_then(|line| line.split("M").nth(1)?.split(' ').next()).expect("a tick");
        assert!(text.contains(&format!("M{x} ")) && text.matches(&format!("M{x} ")).count() == 2);
    }

    #[test]
    fn bodies_of_any_extent_are_pictures_of_numbers() {
        let line = [[0.0, 0.0], [1e-9, 0.0], [2e-9, 0.0]];
        let tall = [[0.0, 0.0], [1.0, 50.0], [0.5, 20.0]];
        let point = [[3.0, 3.0]];
        for points in [&line[..], &tall, &point] {
            let text = picture(points, &vec![7.0; points.len()], (7.0, 7.0));
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
            assert_eq!(text.matches("h0").count(), points.len());
        }
    }
}
