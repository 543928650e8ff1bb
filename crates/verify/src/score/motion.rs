//! The motion of a recording, read once and compared with many solutions.

use mmsmith_runtime::{AnySolution, Solution};
use nalgebra::SVector;

use super::error::ScoreError;
use super::findings::Remarks;
use super::options::{Input, ScoreOptions};
use super::points::decide;
use super::recording::Opened;
use super::row::Source;
use super::times::{Timed, open};
use crate::dimension::in_dimension;

/// Reference positions and displacements of a recording.
pub struct RecordedMotion {
    frames: Vec<Frame>,
}

struct Frame {
    time: f64,
    /// Coordinates of the reference positions, point after point.
    X: Vec<f64>,
    /// Components of the displacements.
    u: Vec<f64>,
}

impl RecordedMotion {
    /// Reads a recording. None where its reference positions follow from the exact motion, and are others for another one.
    ///
    /// # Errors
    ///
    /// [`ScoreError`] where it cannot be read.
    pub fn read(
        exact: &AnySolution<f64>,
        input: &Input,
        options: &ScoreOptions,
    ) -> Result<Option<Self>, ScoreError> {
        in_dimension!(exact, |exact| Self::read_in(exact, input, options), else Err(ScoreError::Dimension))
    }

    fn read_in<const D: usize>(
        exact: &dyn Solution<f64, D>,
        input: &Input,
        options: &ScoreOptions,
    ) -> Result<Option<Self>, ScoreError> {
        let decision = decide(exact, std::slice::from_ref(input), options)?;
        let mut remarks = Remarks::default();
        let opened = Opened::new(exact, input, options, &decision.taken[0], &mut remarks)?;
        if opened.sources().0 == Source::FirstFrame {
            return Ok(None);
        }
        let mut reader = opened.reader(exact, options, &mut remarks);
        let frame = |(index, frame): (usize, &Timed)| {
            let data = reader.frame(&open(&frame.file)?, frame.time, index)?;
            let flat =
                |all: &[SVector<f64, D>]| all.iter().flat_map(|one| one.iter().copied()).collect();
            Ok::<_, ScoreError>(Frame { time: frame.time, X: flat(&data.X), u: flat(&data.u) })
        };
        let frames = opened.found.timed.iter().enumerate().map(frame).collect::<Result<_, _>>()?;
        Ok(Some(Self { frames }))
    }

    /// The largest root of the mean square of the errors of the displacement in a frame; not a number in another dimension.
    #[must_use]
    pub fn misfit(&self, exact: &AnySolution<f64>) -> f64 {
        in_dimension!(exact, |exact| self.misfit_in(exact), else f64::NAN)
    }

    fn misfit_in<const D: usize>(&self, exact: &dyn Solution<f64, D>) -> f64 {
        let of_frame = |Frame { time, X, u }: &Frame| {
            let points = X.chunks_exact(D).zip(u.chunks_exact(D));
            let count = points.len() as f64;
            let square = |(X, u): (&[f64], &[f64])| {
                let [X, u] = [X, u].map(SVector::<f64, D>::from_column_slice);
                (u - exact.displacement(&X, *time)).norm_squared()
            };
            (points.map(square).sum::<f64>() / count).sqrt()
        };
        self.frames
            .iter()
            .map(of_frame)
            .fold(0.0, |most: f64, own| if own > most || own.is_nan() { own } else { most })
    }
}
