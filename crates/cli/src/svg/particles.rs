//! Particles in the plane, coloured by a value.

use std::fmt::Write;

use super::{escape, open};

const WIDTH: f64 = 480.0;
/// The square that holds the body.
const LEFT: f64 = 16.0;
const TOP: f64 = 38.0;
const SIDE: f64 = 370.0;
/// The colour bar.
const BAR: f64 = 402.0;
const BAR_WIDTH: f64 = 18.0;
const HEIGHT: f64 = 420.0;
/// Ten steps of the map viridis, reversed: it darkens evenly, so that it reads the same in grey.
const COLOURS: [&str; 10] = [
    "#fde725", "#b5de2b", "#6ece58", "#35b779", "#1f9e89", "#26828e", "#31688e", "#3e4989",
    "#482878", "#440154",
];

/// Particles with a value each.
pub(crate) struct Particles<'a> {
    pub(crate) title: &'a str,
    /// Positions in the plane.
    pub(crate) points: &'a [[f64; 2]],
    pub(crate) values: &'a [f64],
    /// Values of the two ends of the colour bar; beyond them the end's colour is used.
    pub(crate) range: (f64, f64),
    pub(crate) unit: &'a str,
}

impl Particles<'_> {
    pub(crate) fn svg(&self) -> String {
        let (low, high) = self.range;
        let (least, most) = extremes(self.values.iter().copied());
        let description = format!(
            "{} particles, values from {least:.3e} to {most:.3e} {}; darker is larger.",
            self.points.len(),
            self.unit
        );
        let mut text = open("particles", WIDTH, HEIGHT, self.title, &description);
        let _ = writeln!(
            text,
            r##"<text x="{LEFT}" y="22" font-size="15" font-weight="bold">{}</text>"##,
            escape(self.title)
        );
        let (x_low, x_high) = extremes(self.points.iter().map(|p| p[0]));
        let (y_low, y_high) = extremes(self.points.iter().map(|p| p[1]));
        let scale = (SIDE - 12.0) / (x_high - x_low).max(y_high - y_low);
        // As wide as the particles' share of the area, so that neighbours just touch.
        let area = (x_high - x_low) * (y_high - y_low);
        let width = 0.95 * scale * (area / self.points.len() as f64).sqrt();
        let mut bands = vec![String::new(); COLOURS.len()];
        for (point, value) in self.points.iter().zip(self.values) {
            let share = (value - low) / (high - low);
            let band = (share * COLOURS.len() as f64).clamp(0.0, COLOURS.len() as f64 - 0.5);
            let x = LEFT + 6.0 + scale * (point[0] - x_low);
            let y = TOP + SIDE - 6.0 - scale * (point[1] - y_low);
            // A line of no length with round ends is a dot.
            let _ = write!(bands[band as usize], "M{x:.1} {y:.1}h0");
        }
        for (colour, dots) in COLOURS.iter().zip(&bands).filter(|(_, dots)| !dots.is_empty()) {
            let _ = writeln!(
                text,
                r##"<path class="dots" data-colour="{colour}" d="{dots}" stroke="{colour}" stroke-width="{width:.2}" stroke-linecap="round"/>"##
            );
        }
        let step = SIDE / COLOURS.len() as f64;
        for (index, colour) in COLOURS.iter().enumerate() {
            let y = TOP + SIDE - step * (index + 1) as f64;
            let _ = writeln!(
                text,
                r##"<rect x="{BAR}" y="{y:.1}" width="{BAR_WIDTH}" height="{step:.1}" fill="{colour}"/>"##
            );
        }
        for tick in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let y = TOP + SIDE * (1.0 - tick);
            let _ = writeln!(
                text,
                r##"<text x="{}" y="{:.1}" font-size="13">{:.0}</text>"##,
                BAR + BAR_WIDTH + 5.0,
                y + 5.0,
                low + tick * (high - low)
            );
        }
        let _ = writeln!(
            text,
            r##"<rect x="{BAR}" y="{TOP}" width="{BAR_WIDTH}" height="{SIDE}" fill="none" stroke="#333"/>
<text x="{}" y="22" text-anchor="end">{}</text>
</svg>"##,
            WIDTH - 8.0,
            escape(self.unit)
        );
        text
    }
}

/// The smallest and the largest of some values.
pub(crate) fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_particle_is_a_dot_in_the_colour_of_its_value() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let text = Particles {
            title: "t",
            points: &points,
            values: &[0.0, 10.0, -5.0, 25.0],
            range: (0.0, 10.0),
            unit: "Pa",
        }
        .svg();
        let dots = |colour| {
            let path = text.lines().find(|l| l.contains("dots") && l.contains(colour));
            path.map_or(0, |path| path.matches("h0").count())
        };
        assert_eq!((dots(COLOURS[0]), dots(COLOURS[9])), (2, 2));
    }
}
