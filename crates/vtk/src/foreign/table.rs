//! Particles in comma-separated values.

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;
use std::path::Path;

use super::numbers::to_whole;

/// The columns of a CSV file, and the rows that belong to one time each.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) arrays: Vec<Columns>,
    columns: Vec<Vec<f64>>,
    /// How many digits the numbers of each column have.
    digits: Vec<Digits>,
    /// The frames, in order.
    pub(super) frames: Vec<Rows>,
}

/// The rows of one frame.
#[derive(Debug, PartialEq)]
pub(super) struct Rows {
    /// The frame's time, if there is a column of it.
    pub(super) time: Option<f64>,
    pub(super) range: Range<usize>,
}

/// The columns that make up one array.
#[derive(Debug)]
pub(super) struct Columns {
    pub(super) name: String,
    /// Their indices, component by component.
    indices: Vec<usize>,
}

/// The name of the array that holds the positions.
pub(super) const POINTS: &str = "Points";
/// The name of the array that holds reference positions given by `X`, `Y`, `Z`.
const REFERENCE: &str = "X";

impl Table {
    /// Reads a file with one header line.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let delimiter = delimiter(bytes)?;
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .delimiter(delimiter)
            .from_reader(bytes);
        let header = reader.headers().map_err(|cause| cause.to_string())?.clone();
        let mut columns: Vec<Vec<f64>> = vec![vec![]; header.len()];
        let mut digits = vec![Digits::default(); header.len()];
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(|cause| damage(&cause, &header))? {
            for (index, (column, word)) in columns.iter_mut().zip(&record).enumerate() {
                let value = number(word, delimiter).map_err(|hint| {
                    let line = record.position().map_or(0, csv::Position::line);
                    format!("line {line}, column `{}`: {word:?} is no number{hint}", &header[index])
                })?;
                digits[index].count(word);
                column.push(value);
            }
        }
        let arrays = group(&header)?;
        let time =
            header.iter().position(|name| ["t", "time", "Time", "TimeValue"].contains(&name));
        let rows = columns.first().map_or(0, Vec::len);
        let frames = frames(time.map(|time| &columns[time][..]), rows)?;
        Ok(Self { arrays, columns, digits, frames })
    }

    fn find(&self, name: &str) -> Option<&Columns> {
        self.arrays.iter().find(|array| array.name == name)
    }

    /// The components of an array in some rows, row by row.
    pub(super) fn floats(&self, name: &str, rows: Range<usize>) -> Option<Vec<f64>> {
        let indices = &self.find(name)?.indices;
        let row = |row| indices.iter().map(move |index| self.columns[*index][row]);
        Some(rows.flat_map(row).collect())
    }

    pub(super) fn integers(
        &self,
        name: &str,
        rows: Range<usize>,
    ) -> Option<Result<Vec<i64>, String>> {
        Some(self.floats(name, rows)?.into_iter().map(to_whole).collect())
    }
}

/// More columns than a table of particles has.
const MOST_COLUMNS: usize = 10_000;

/// The character between the columns: comma, semicolon or tab, the one that the header has most often.
fn delimiter(bytes: &[u8]) -> Result<u8, String> {
    let lines = bytes.split(|byte| *byte == b'\n');
    let header = lines.into_iter().find(|line| !line.trim_ascii().is_empty() && line[0] != b'#');
    let header = header.unwrap_or_default();
    let count = |delimiter: u8| header.iter().filter(|byte| **byte == delimiter).count();
    // Of equals the last one is taken, which is the comma.
    let (count, delimiter) = [b'\t', b';', b',']
        .map(|delimiter| (count(delimiter), delimiter))
        .into_iter()
        .max_by_key(|(count, _)| *count)
        .unwrap_or((0, b','));
    if count >= MOST_COLUMNS {
        return Err(format!("it has {} columns; at most {MOST_COLUMNS} are read", count + 1));
    }
    Ok(delimiter)
}

/// A number with a decimal point, or with a decimal comma where commas do not separate columns; else the reason, to be added
/// to the refusal.
fn number(word: &str, delimiter: u8) -> Result<f64, &'static str> {
    if let Ok(value) = word.parse() {
        return Ok(value);
    }
    if delimiter != b',' && word.contains(',') {
        return word.replacen(',', ".", 1).parse().map_err(|_| "");
    }
    // A whole line in one column.
    Err(match word.contains(';') {
        true => {
            "; columns are separated by the character that the header has: write the header with semicolons too"
        }
        false => "",
    })
}

/// The reader's own words, and the likeliest reason where lines have more columns than the header.
fn damage(cause: &csv::Error, header: &csv::StringRecord) -> String {
    let decimal_commas = match cause.kind() {
        csv::ErrorKind::UnequalLengths { len, .. } => *len > header.len() as u64,
        _ => false,
    };
    match decimal_commas {
        true => format!(
            "{cause}; are there decimal commas? Write decimal points (0.5), or separate columns by semicolons (x;y)"
        ),
        false => cause.to_string(),
    }
}

/// How many significant digits numbers have, as they are written.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Digits {
    /// Numbers with a fraction or an exponent.
    fractions: usize,
    /// The most digits that one of them has.
    most: usize,
}

impl Digits {
    /// As many numbers with a fraction tell the digits of all: fewer may happen to be short.
    const ENOUGH: usize = 8;

    pub(super) fn count(&mut self, word: &str) {
        let mantissa = word.split(['e', 'E', 'd', 'D']).next().unwrap_or_default();
        if !word.contains(['.', ',', 'e', 'E']) {
            return;
        }
        let significant =
            mantissa.bytes().filter(u8::is_ascii_digit).skip_while(|digit| *digit == b'0').count();
        if significant > 0 {
            self.fractions += 1;
            self.most = self.most.max(significant);
        }
    }

    /// The digits of the longest number, where there are enough to tell.
    pub(super) fn most(self) -> Option<usize> {
        (self.fractions >= Self::ENOUGH).then_some(self.most)
    }
}

impl Columns {
    pub(super) fn components(&self) -> usize {
        self.indices.len()
    }

    /// The digits of the longest number of an array, where its columns tell.
    pub(super) fn digits(&self, table: &Table) -> Option<usize> {
        self.indices.iter().filter_map(|index| table.digits[*index].most()).max()
    }
}

/// Successive rows of one time are a frame.
fn frames(times: Option<&[f64]>, rows: usize) -> Result<Vec<Rows>, String> {
    let Some(times) = times else { return Ok(vec![Rows { time: None, range: 0..rows }]) };
    let mut frames: Vec<Rows> = vec![];
    let mut seen = HashSet::new();
    for (row, &time) in times.iter().enumerate() {
        match frames.last_mut() {
            Some(last) if last.time.map(f64::to_bits) == Some(time.to_bits()) => {
                last.range.end = row + 1;
            }
            _ if seen.insert(time.to_bits()) => {
                frames.push(Rows { time: Some(time), range: row..row + 1 });
            }
            _ => {
                return Err(format!(
                    "rows of time {time:?} do not stand together: sort the rows by time"
                ));
            }
        }
    }
    if frames.is_empty() {
        frames.push(Rows { time: None, range: 0..0 });
    }
    Ok(frames)
}

/// What a component's ending means: its row and column, or its index alone.
fn component(ending: &str) -> Option<Component> {
    let axis = |c: u8| b"xyz".iter().position(|a| *a == c.to_ascii_lowercase());
    let digit = |c: u8| b"123".iter().position(|a| *a == c);
    match ending.as_bytes() {
        [c] => axis(*c).map(Component::Vector),
        [i, j] => {
            let pair = axis(*i).zip(axis(*j)).or_else(|| digit(*i).zip(digit(*j)));
            pair.map(|(i, j)| Component::Tensor(i, j))
        }
        _ => None,
    }
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Component {
    Index(usize),
    Vector(usize),
    Tensor(usize, usize),
}

/// The array and the component that a column's name stands for; `None` where it is an array by itself.
fn split(column: &str) -> Option<(&str, Component)> {
    match column {
        "x" | "y" | "z" => return Some((POINTS, component(column)?)),
        "X" | "Y" | "Z" => return Some((REFERENCE, component(column)?)),
        _ => (),
    }
    // As ParaView's table writer and many scripts name components.
    if let Some((name, index)) = column.rsplit_once(':') {
        return index.parse().ok().map(|index| (name, Component::Index(index)));
    }
    if let Some((name, ending)) = column.rsplit_once('_') {
        let known = component(ending);
        let index = || ending.parse().ok().filter(|index| *index < 9).map(Component::Index);
        return known.or_else(index).map(|component| (name, component));
    }
    let is_short = matches!(column.as_bytes().first(), Some(b'u' | b'v' | b'F' | b'P'));
    let ending = column.get(1..).filter(|_| is_short)?;
    component(ending).map(|component| (&column[..1], component))
}

fn group(header: &csv::StringRecord) -> Result<Vec<Columns>, String> {
    let mut order: Vec<&str> = vec![];
    let mut members: BTreeMap<&str, Vec<(Component, usize)>> = BTreeMap::new();
    for (index, column) in header.iter().enumerate() {
        let (name, component) = split(column).unwrap_or((column, Component::Index(0)));
        if !members.contains_key(name) {
            order.push(name);
        }
        members.entry(name).or_default().push((component, index));
    }
    let mut arrays = vec![];
    for name in order {
        let mut components = members.remove(name).unwrap_or_default();
        components.sort_unstable();
        let width = match components.len() {
            4 => 2,
            9 => 3,
            _ => 1,
        };
        let is_whole = components.iter().enumerate().all(|(at, (component, _))| match component {
            Component::Index(index) | Component::Vector(index) => *index == at,
            Component::Tensor(i, j) => width * i + j == at,
        });
        let columns: Vec<_> =
            components.iter().map(|(_, index)| (&header[*index], *index)).collect();
        if is_whole {
            let indices = columns.into_iter().map(|(_, index)| index).collect();
            arrays.push(Columns { name: name.to_owned(), indices });
        } else if [POINTS, REFERENCE, "u", "v", "F", "P"].contains(&name) {
            let (size, columns): (_, Vec<_>) =
                (columns.len(), columns.iter().map(|(column, _)| *column).collect());
            return Err(format!(
                "the {size} column(s) {} are no complete vector or tensor `{name}`",
                columns.join(", ")
            ));
        } else {
            // Names that end like components but are none.
            for (column, index) in columns {
                arrays.push(Columns { name: column.to_owned(), indices: vec![index] });
            }
        }
    }
    Ok(arrays)
}

/// Whether a path names such a file.
pub(super) fn is_csv(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_become_arrays_whatever_their_order_and_rows_frames() {
        let text = "id,y,x,t,u_y,u_x,F11,F12,F21,F22,v:0,v:1,mass\n\
                    1,2,1,0,4,3,5,6,7,8,9,10,0.5\n\
                    2,2,1,0,4,3,5,6,7,8,9,10,0.5\n\
                    1,3,1,0.5,4,3,5,6,7,8,9,10,0.5\n";
        let table = Table::read(text.as_bytes()).unwrap();
        let rows = |time, range| Rows { time: Some(time), range };
        assert_eq!(table.frames, [rows(0.0, 0..2), rows(0.5, 2..3)]);
        assert_eq!(table.floats(POINTS, 2..3), Some(vec![1.0, 3.0]));
        assert_eq!(table.floats("u", 0..1), Some(vec![3.0, 4.0]));
        assert_eq!(table.floats("F", 0..1), Some(vec![5.0, 6.0, 7.0, 8.0]));
        assert_eq!(table.floats("v", 0..1), Some(vec![9.0, 10.0]));
        assert_eq!(table.integers("id", 0..2), Some(Ok(vec![1, 2])));
        assert_eq!(
            table.arrays.iter().find(|array| array.name == "mass").map(Columns::components),
            Some(1)
        );
        assert_eq!(table.floats("w", 0..1), None);
        let table = Table::read(b"x,node_1,node_3,S12\n1,2,3,4\n").unwrap();
        assert_eq!(table.floats("node_3", 0..1), Some(vec![3.0]));
        assert_eq!(table.floats("S12", 0..1), Some(vec![4.0]));
    }

    #[test]
    fn semicolons_and_tabs_separate_columns_and_leave_commas_for_decimals() {
        for text in ["x;y\n0,5;1.5\n", "x\ty\n0,5\t1,5\n", "x,y\n0.5,1.5\n"] {
            let table = Table::read(text.as_bytes()).expect(text);
            assert_eq!(table.floats(POINTS, 0..1), Some(vec![0.5, 1.5]), "{text}");
        }
    }

    #[test]
    fn the_digits_of_text_are_counted_where_there_are_enough_numbers() {
        let table = |word: &str| {
            Table::read(format!("mass\n{}", format!("{word}\n").repeat(8)).as_bytes()).unwrap()
        };
        for (word, expected) in [
            ("0.0012345", Some(5)),
            ("-1.2345e-07", Some(5)),
            ("0.30000000000000004", Some(17)),
            ("12", None),
            ("0.0", None),
        ] {
            let table = table(word);
            assert_eq!(table.arrays[0].digits(&table), expected, "{word}");
        }
    }

    #[test]
    fn more_columns_than_anybody_has_are_refused_by_their_header_alone() {
        let header = "a,".repeat(MOST_COLUMNS) + "b\n";
        let message = Table::read(header.as_bytes()).unwrap_err();
        assert!(message.contains("10001 columns; at most 10000"), "{message}");
    }

    #[test]
    fn what_is_wrong_is_told() {
        for (text, expected) in [
            ("x,y\n1,z\n", "line 2, column `y`: \"z\""),
            ("x,y\n1\n", "fields"),
            ("x,z\n1,2\n", "no complete vector or tensor `Points`"),
            ("F11,F12,F21\n1,2,3\n", "no complete vector or tensor `F`"),
            ("t,x\n0,1\n1,1\n0,2\n", "sort the rows by time"),
            ("x,x\n0,1\n", "no complete"),
            ("x,y\n0,5,1,5\n", "decimal commas? Write decimal points (0.5)"),
        ] {
            let message = Table::read(text.as_bytes()).expect_err(text);
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}
