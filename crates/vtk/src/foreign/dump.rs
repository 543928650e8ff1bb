//! Text dumps of LAMMPS and of codes that write its form, such as Karamelo: one or several frames, each with a list of columns.

use super::table::{Filled, Rows, Table};

/// The beginning of every frame.
pub(super) const BEGINNING: &[u8] = b"ITEM: TIMESTEP";

/// Names of columns that hold words.
const WORDS: [&str; 1] = ["element"];

/// Reads all frames of a dump. Its `TIMESTEP` is a number of steps, no time; a time is told by `ITEM: TIME` alone.
pub(super) fn read(bytes: &[u8]) -> Result<Table, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it holds bytes that are no text")?;
    let mut lines = (1..).zip(text.lines());
    let mut filled: Option<Filled> = None;
    let (mut time, mut count) = (None, None);
    let mut frames: Vec<Rows> = vec![];
    while let Some((number, line)) = lines.next() {
        let Some(item) = line.trim().strip_prefix("ITEM:").map(str::trim) else {
            return Err(format!("line {number}: expected a line that begins with \"ITEM:\""));
        };
        let mut value = || lines.next().map(|(_, line)| line.trim()).ok_or("the file was cut off");
        match item.split_whitespace().next().unwrap_or_default() {
            "TIMESTEP" => (time, count) = (value().map(|_| None)?, None),
            "TIME" => {
                let word = value()?;
                time = Some(word.parse().map_err(|_| format!("{word:?} is no time"))?);
            }
            "NUMBER" => {
                let word = value()?;
                count = Some(word.parse().map_err(|_| format!("{word:?} is no count"))?);
            }
            "ATOMS" => {
                let names: Vec<String> =
                    item.split_whitespace().skip(1).map(str::to_owned).collect();
                let filled = match &mut filled {
                    Some(filled) if filled.names() == names => filled,
                    Some(_) => {
                        return Err(format!(
                            "line {number}: the columns are not those of the first frame"
                        ));
                    }
                    None => filled.insert(Filled::new(names)?),
                };
                let count = count.ok_or("ITEM: NUMBER OF ATOMS is missing")?;
                let start = frames.last().map_or(0, |frame| frame.range.end);
                atoms(filled, &mut lines, count)?;
                frames.push(Rows { time, range: start..start + count });
            }
            // The box, units and other things: lines up to the next item.
            "BOX" => (0..3).try_for_each(|_| value().map(|_| ()))?,
            _ => value().map(|_| ())?,
        }
    }
    filled.ok_or("it holds no ITEM: ATOMS")?.table(frames)
}

/// Takes the rows of a frame.
fn atoms<'a>(
    filled: &mut Filled,
    lines: &mut impl Iterator<Item = (u64, &'a str)>,
    count: usize,
) -> Result<(), String> {
    // Words are not compared.
    let is_word: Vec<bool> =
        filled.names().iter().map(|name| WORDS.contains(&name.as_str())).collect();
    for found in 0..count {
        let cut = || format!("{found} of {count} atoms are there: the file was cut off");
        let (number, line) = lines.next().ok_or_else(cut)?;
        let words: Vec<_> = line.split_whitespace().collect();
        if words.len() != is_word.len() {
            return Err(format!(
                "line {number}: {} columns where there are {}",
                words.len(),
                is_word.len()
            ));
        }
        let numbers = words
            .into_iter()
            .zip(&is_word)
            .map(|(word, is_word)| if *is_word { "0" } else { word });
        filled.row(numbers, b' ', number)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: &str = "ITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\nITEM: ATOMS id element x y x0 y0\n\
                         2 Al 1 2 3 4\n1 Al 5 6 7 8\n";

    #[test]
    fn frames_of_a_dump_are_read_with_the_time_that_they_tell() {
        let text =
            format!("ITEM: TIMESTEP\n0\n{FRAME}ITEM: TIMESTEP\n300\nITEM: TIME\n0.5\n{FRAME}");
        let table = read(text.as_bytes()).unwrap();
        let told: Vec<_> =
            table.frames.iter().map(|rows| (rows.time, rows.range.clone())).collect();
        assert_eq!(told, [(None, 0..2), (Some(0.5), 2..4)]);
        assert_eq!(table.floats("Points", 2..4), Some(vec![1.0, 2.0, 5.0, 6.0]));
        assert_eq!(table.floats("X", 0..1), Some(vec![3.0, 4.0]));
    }

    #[test]
    fn damaged_dumps_are_told() {
        for (text, expected) in [
            ("ITEM: TIMESTEP\n0\n", "no ITEM: ATOMS"),
            ("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: ATOMS x\n1\n", "1 of 2 atoms"),
            (
                "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS x y\n1\n",
                "1 columns where there are 2",
            ),
            ("ITEM: TIMESTEP\n0\nnonsense\n", "line 3"),
        ] {
            let message = read(text.as_bytes()).expect_err(text);
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}
