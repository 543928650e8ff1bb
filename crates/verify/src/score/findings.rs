//! Remarks on a recording besides its errors.

use serde::Serialize;

/// Something that a reader of the errors has to know.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Remark {
    /// The subject, such as `not-finite` or `single-precision`.
    pub kind: &'static str,
    /// Whether the errors are not those of the whole recording, or of nothing sensible. Such a row has no part in
    /// orders, unless the problem is the size of its errors alone.
    pub is_problem: bool,
    /// How many particles, frames or files it concerns; over all frames.
    pub count: usize,
    /// How many frames it concerns.
    pub frames: usize,
    /// The whole of it in words.
    pub message: String,
}

/// Collects what is met frame by frame: one remark for each kind and subject.
#[derive(Default)]
pub(super) struct Remarks {
    met: Vec<(Key, Met)>,
}

#[derive(PartialEq)]
struct Key {
    kind: &'static str,
    is_problem: bool,
    /// The things that were met, in the words that follow the count.
    what: String,
}

struct Met {
    count: usize,
    frames: usize,
    /// Where it was first met, in words; nothing for what concerns the recording.
    first: String,
}

impl Remarks {
    /// Notes that `count` things, "particles whose velocity is not finite" say, were met in a frame, the first of them
    /// at `first`; nothing where the count is zero.
    pub(super) fn met(
        &mut self,
        kind: &'static str,
        is_problem: bool,
        count: usize,
        what: impl Into<String>,
        first: impl FnOnce() -> String,
    ) {
        if count == 0 {
            return;
        }
        let key = Key { kind, is_problem, what: what.into() };
        match self.met.iter_mut().find(|(known, _)| *known == key) {
            Some((_, met)) => {
                met.count += count;
                met.frames += 1;
            }
            None => self.met.push((key, Met { count, frames: 1, first: first() })),
        }
    }

    /// Notes something about the recording as a whole, once.
    pub(super) fn note(&mut self, kind: &'static str, is_problem: bool, what: impl Into<String>) {
        let key = Key { kind, is_problem, what: what.into() };
        if !self.met.iter().any(|(known, _)| *known == key) {
            self.met.push((key, Met { count: 1, frames: 0, first: String::new() }));
        }
    }

    /// Whether anything of this kind was met.
    pub(super) fn has(&self, kind: &str) -> bool {
        self.met.iter().any(|(known, _)| known.kind == kind)
    }

    /// Everything in words; problems first.
    pub(super) fn list(self) -> Vec<Remark> {
        let mut remarks: Vec<_> = self
            .met
            .into_iter()
            .map(|(Key { kind, is_problem, what }, Met { count, frames, first })| {
                let message = match frames {
                    0 => what,
                    1 => format!("{count} {what}: {first}"),
                    _ => format!("{count} {what}, in {frames} frames; first: {first}"),
                };
                Remark { kind, is_problem, count, frames, message }
            })
            .collect();
        remarks.sort_by_key(|remark| !remark.is_problem);
        remarks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_add_up_over_frames_and_problems_come_first() {
        let mut remarks = Remarks::default();
        remarks.note("h", false, "a note");
        remarks.note("h", false, "a note");
        remarks.met("nan", true, 2, "particles with NaN", || "particle 7".into());
        remarks.met("nan", true, 3, "particles with NaN", || "particle 8".into());
        remarks.met("nan", true, 0, "particles with NaN elsewhere", || "none".into());
        let list = remarks.list();
        assert_eq!(list.len(), 2);
        assert_eq!((list[0].count, list[0].frames, list[0].is_problem), (5, 2, true));
        assert_eq!(list[0].message, "5 particles with NaN, in 2 frames; first: particle 7");
        assert_eq!(list[1].message, "a note");
    }
}
