//! Pictures of particles, coloured by their stress.

use anyhow::{Result, bail};
use mmsmith_verify::{Row, Snapshot, Status};
use mmsmith_vtk::{Frame, Values};

use crate::arguments::{PictureOptions, Stress};
use crate::json::Output;
use crate::library::Selection;
use crate::number;
use crate::svg::Particles;
use crate::units::{Units, with_unit};

impl Stress {
    /// Its name.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::VonMises => "von Mises stress",
            Self::Pressure => "pressure",
            Self::Xx => "stress xx",
            Self::Yy => "stress yy",
            Self::Zz => "stress zz",
            Self::Xy => "shear stress xy",
            Self::Xz => "shear stress xz",
            Self::Yz => "shear stress yz",
            Self::Radial => "radial stress",
            Self::Hoop => "hoop stress",
        }
    }

    /// Its value at a position with a Cauchy stress, by rows.
    fn of(self, x: &[f64; 3], s: &[f64; 9]) -> f64 {
        let [xx, xy, xz, _, yy, yz, _, _, zz] = *s;
        match self {
            Self::VonMises => {
                let normal = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
                (0.5 * normal + 3.0 * (xy * xy + yz * yz + xz * xz)).sqrt()
            }
            Self::Pressure => -(xx + yy + zz) / 3.0,
            Self::Xx => xx,
            Self::Yy => yy,
            Self::Zz => zz,
            Self::Xy => xy,
            Self::Xz => xz,
            Self::Yz => yz,
            Self::Radial | Self::Hoop => {
                let length = x[0].hypot(x[1]);
                // On the axis every direction is radial.
                let (c, n) = if length > 0.0 { (x[0] / length, x[1] / length) } else { (1.0, 0.0) };
                let e = if self == Self::Hoop { [-n, c] } else { [c, n] };
                e[0] * (xx * e[0] + xy * e[1]) + e[1] * (xy * e[0] + yy * e[1])
            }
        }
    }

    /// Its values at all particles.
    pub(super) fn values(self, frame: &Frame) -> Result<Vec<f64>> {
        let stress = frame.arrays.iter().find(|array| array.name == "stress");
        let Some(Values::Tensor(stress)) = stress.map(|array| &array.values) else {
            bail!("the particles have no stress")
        };
        Ok(frame.points.iter().zip(stress).map(|(x, s)| self.of(x, s)).collect())
    }
}

/// Coordinates that a picture has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// The first two; in space those nearest to a viewer on the third axis are drawn last.
    Plane,
    /// Radius and height about the third axis.
    HalfPlane,
}

impl View {
    /// The view of a body of revolution, whose frames of the half plane are plane themselves; and of other bodies.
    fn of(is_axisymmetric: bool, frame: &Frame) -> Self {
        let is_in_space = frame.points.iter().any(|x| x[2] != 0.0);
        if is_axisymmetric && is_in_space { Self::HalfPlane } else { Self::Plane }
    }

    fn place(self, x: &[f64; 3]) -> [f64; 2] {
        match self {
            Self::Plane => [x[0], x[1]],
            Self::HalfPlane => [x[0].hypot(x[1]), x[2]],
        }
    }

    fn axes(self) -> [&'static str; 2] {
        match self {
            Self::Plane => ["x", "y"],
            Self::HalfPlane => ["r", "z"],
        }
    }
}

/// The particles of a frame with a value each, and a note below them.
pub(super) fn draw(
    title: &str,
    (frame, view): (&Frame, View),
    values: &[f64],
    range: (f64, f64),
    units: Option<Units>,
    note: &str,
) -> String {
    let mut order: Vec<usize> = (0..frame.points.len()).collect();
    order.sort_by(|&a, &b| frame.points[a][2].total_cmp(&frame.points[b][2]));
    let points: Vec<[f64; 2]> = order.iter().map(|&p| view.place(&frame.points[p])).collect();
    let values: Vec<f64> = order.iter().map(|&p| values[p]).collect();
    let unit = units.map_or("", Units::stress);
    let axes = view.axes().map(|axis| with_unit(axis, units.map(Units::length)));
    let axes = [axes[0].as_str(), axes[1].as_str()];
    Particles { title, points: &points, values: &values, range, unit, axes, note }.svg()
}

/// The values between which 98 % of them lie, so that single particles do not take the colours from the rest.
pub(super) fn range(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let at =
        |share: f64| sorted.get((share * last as f64).round() as usize).copied().unwrap_or(0.0);
    (at(0.01), at(0.99))
}

/// A picture that a run was asked for.
pub(super) struct Picture {
    stress: Stress,
    /// The moment in periods.
    at: f64,
    /// The file; the first one of several processes has it.
    output: Option<Output>,
    snapshot: Snapshot,
}

impl Picture {
    /// The picture that the options ask for, if any, of a run of so many periods.
    pub(super) fn asked(options: &PictureOptions, periods: f64) -> Result<Option<Self>> {
        if options.file.is_none() {
            return Ok(None);
        }
        let output = Output::prepare_if(options.file.as_ref())?;
        let at = options.at.unwrap_or(periods);
        if at > periods {
            let (at, ends) = (number::exact(at), number::of_periods(periods));
            bail!("--at {at}: the run ends after {ends}; write --periods {at} as well");
        }
        let snapshot = Snapshot { share: at / periods, frame: None };
        Ok(Some(Self { stress: options.stress, at, output, snapshot }))
    }

    pub(super) fn snapshot(&mut self) -> &mut Snapshot {
        &mut self.snapshot
    }

    /// Draws what the run left, with a note on the run; bodies of revolution by radius and height.
    pub(super) fn write(
        self,
        selection: &Selection,
        is_axisymmetric: bool,
        row: &Row,
        note: &str,
    ) -> Result<()> {
        let Some(output) = self.output else { return Ok(()) };
        let Some(frame) = &self.snapshot.frame else {
            match &row.status {
                Status::Ok => bail!(
                    "--picture: a particle is turned inside out at {} and has no stress",
                    number::of_periods(self.at)
                ),
                status => bail!(
                    "--picture: the run did not come to {}, and nothing is drawn: {status}; --at TIME draws an earlier moment",
                    number::of_periods(self.at)
                ),
            }
        };
        let values = self.stress.values(frame)?;
        let units = Units::of(selection);
        let second = units.map_or_else(String::new, |units| format!(" {}", units.time()));
        let title = format!(
            "{}: {}, t = {}{second}",
            selection.name(),
            self.stress.words(),
            number::rounded(frame.time, 4)
        );
        output.write_text(&draw(
            &title,
            (frame, View::of(is_axisymmetric, frame)),
            &values,
            range(&values),
            units,
            note,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalars_of_a_stress_are_those_of_the_textbook() {
        // Uniaxial tension of 2 along the second axis.
        let pull = [0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0];
        let on = |x: [f64; 3], stress: Stress| stress.of(&x, &pull);
        let up = [0.0, 3.0, 1.0];
        assert_eq!((on(up, Stress::Radial), on(up, Stress::Hoop)), (2.0, 0.0));
        let right = [3.0, 0.0, 1.0];
        assert_eq!((on(right, Stress::Radial), on(right, Stress::Hoop)), (0.0, 2.0));
        assert_eq!((on(up, Stress::Yy), on(up, Stress::Xx)), (2.0, 0.0));
        assert_eq!((on(up, Stress::VonMises), on(up, Stress::Pressure)), (2.0, -2.0 / 3.0));
        assert!(on([0.0; 3], Stress::Radial).is_finite());
        // Pure shear.
        let shear = [0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!((Stress::VonMises.of(&up, &shear) - 3.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!((Stress::Xy.of(&up, &shear), Stress::Xz.of(&up, &shear)), (1.0, 0.0));
    }

    #[test]
    fn single_particles_do_not_take_the_colours_from_the_rest() {
        let mut values: Vec<f64> = (0..=100).map(f64::from).collect();
        values[100] = 1e9;
        assert_eq!(range(&values), (1.0, 99.0));
        assert_eq!(range(&[]), (0.0, 0.0));
    }
}
