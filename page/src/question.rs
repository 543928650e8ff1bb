//! Questions of the page.

use crate::refusal::Refusal;
use crate::session::Session;
use crate::{formulas, motion};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A question of the page. All but [`Question::Open`] are about the specification that was opened last.
#[derive(Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Question {
    /// Reads and derives a specification.
    Open {
        /// Its name in messages and in files of hosts.
        file: String,
        /// All of it.
        text: String,
        /// Values in place of the defaults of parameters.
        #[serde(default)]
        set: BTreeMap<String, f64>,
    },
    /// A field as set formulas.
    Formulas {
        /// Its letter.
        field: String,
    },
    /// The file of a host.
    Source {
        /// The host's name.
        host: String,
    },
    /// All fields at places, each at its time, as `mms eval` has them.
    Fields {
        /// Places, and a time behind the coordinates of each.
        points: Vec<Vec<f64>>,
    },
    /// Particles over a period.
    Motion {
        /// About so many.
        particles: usize,
        /// Equal steps of the period.
        frames: usize,
    },
    /// The fields against each other, blind spots, and the terms that are exercised.
    #[cfg(feature = "solver")]
    Check,
    /// Errors of the solver on grids, and their orders.
    #[cfg(feature = "solver")]
    Run {
        /// The cells along the cell length, a grid each.
        cells: Vec<usize>,
    },
}

impl Question {
    pub(crate) fn answer(self, session: &mut Option<Session>) -> Vec<u8> {
        self.found(session).unwrap_or_else(|Refusal(error)| text(&json!({ "error": error })))
    }

    fn found(self, session: &mut Option<Session>) -> Result<Vec<u8>, Refusal> {
        if let Question::Open { file, text: source, set } = self {
            // Nothing of what was open is left where the new one is wrong.
            *session = None;
            let opened = Session::open(&file, &source, &set)?;
            let about = opened.about();
            *session = Some(opened);
            return Ok(text(&about));
        }
        let Some(session) = session else {
            return Err("no specification is open: ask 'open' first, with its text".into());
        };
        Ok(match self {
            Question::Open { .. } => Vec::new(),
            Question::Formulas { field } => text(&formulas::of(session, &field)?),
            Question::Source { host } => text(&session.source(&host)?),
            Question::Fields { points } => text(&session.fields_at(&points)?),
            Question::Motion { particles, frames } => motion::of(session, particles, frames)?,
            #[cfg(feature = "solver")]
            Question::Check => text(&crate::checks::of(session)?),
            #[cfg(feature = "solver")]
            Question::Run { cells } => text(&crate::study::of(session, &cells)?),
        })
    }
}

fn text(value: &Value) -> Vec<u8> {
    value.to_string().into_bytes()
}
