//! Particles in comma-separated values.

use std::borrow::Cow;
use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;

use super::components::{Incomplete, Joined, POINTS, REFERENCE, Source, join};
use super::numbers::to_whole;

/// The columns of a CSV file, and the rows of each time.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) arrays: Vec<Joined>,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// The number of digits in each column.
    digits: Vec<Digits>,
    /// The frames, in order.
    pub(super) frames: Vec<Rows>,
}

/// The rows of one frame.
#[derive(Debug, PartialEq)]
pub(super) struct Rows {
    /// The frame's time, where a column gives it.
    pub(super) time: Option<f64>,
    pub(super) range: Range<usize>,
}

impl Table {
    /// Reads a file with one header line.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let (bytes, delimiter) = prepared(bytes)?;
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .delimiter(delimiter)
            .from_reader(&*bytes);
        let header = reader.headers().map_err(|cause| cause.to_string())?.clone();
        let names: Vec<String> = header.iter().map(str::to_owned).collect();
        let mut filled = Filled::new(names)?;
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(|cause| damage(&cause, &header))? {
            let line = record.position().map_or(0, csv::Position::line);
            filled.row(record.iter(), delimiter, line)?;
        }
        let time = header.iter().position(|name| TIMES.contains(&name));
        let rows = filled.columns.first().map_or(0, Vec::len);
        if let Some(time) = time.filter(|time| is_mixed(&filled.columns[*time])) {
            filled.sort(time);
        }
        let frames = frames(time.map(|time| &filled.columns[time][..]), rows)?;
        filled.table(frames)
    }

    /// The numbers of a column.
    pub(super) fn column(&self, name: &str) -> Option<&[f64]> {
        let index = self.names.iter().position(|column| column == name)?;
        Some(&self.columns[index])
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    fn find(&self, name: &str) -> Option<&Joined> {
        self.arrays.iter().find(|array| array.name == name)
    }

    /// The components of an array in some rows, row by row.
    pub(super) fn floats(&self, name: &str, rows: Range<usize>) -> Option<Vec<f64>> {
        let components = &self.find(name)?.components;
        let value = move |source: &Option<Source>, row: usize| {
            source.map_or(0.0, |source| self.columns[source.array][row])
        };
        let row = |row| components.iter().map(move |source| value(source, row));
        Some(rows.flat_map(row).collect())
    }

    pub(super) fn integers(
        &self,
        name: &str,
        rows: Range<usize>,
    ) -> Option<Result<Vec<i64>, String>> {
        Some(self.floats(name, rows)?.into_iter().map(to_whole).collect())
    }

    /// The digits of the longest number of an array, if its columns show them.
    pub(super) fn digits(&self, array: &Joined) -> Option<usize> {
        let columns = array.components.iter().flatten();
        columns.filter_map(|source| self.digits[source.array].most()).max()
    }
}

/// The names of a column of times.
const TIMES: [&str; 5] = ["t", "time", "Time", "TIME", "TimeValue"];

/// Columns while rows are read.
pub(super) struct Filled {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    digits: Vec<Digits>,
}

impl Filled {
    pub(super) fn new(names: Vec<String>) -> Result<Self, String> {
        let mut seen = HashSet::new();
        if let Some(name) =
            names.iter().find(|name| !name.is_empty() && !seen.insert(name.as_str()))
        {
            return Err(format!(
                "the column `{name}` stands twice in the header: rename or remove one of the two"
            ));
        }
        let (columns, digits) = (vec![vec![]; names.len()], vec![Digits::default(); names.len()]);
        Ok(Self { names, columns, digits })
    }

    /// Sorts rows by a column; rows with equal values keep their order.
    fn sort(&mut self, by: usize) {
        let mut order: Vec<usize> = (0..self.columns[by].len()).collect();
        order.sort_by(|one, other| self.columns[by][*one].total_cmp(&self.columns[by][*other]));
        for column in &mut self.columns {
            *column = order.iter().map(|row| column[*row]).collect();
        }
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Takes the words of a line.
    pub(super) fn row<'a>(
        &mut self,
        words: impl Iterator<Item = &'a str>,
        delimiter: u8,
        line: u64,
    ) -> Result<(), String> {
        for (index, (column, word)) in self.columns.iter_mut().zip(words).enumerate() {
            let value = number(word, delimiter).map_err(|hint| {
                format!("line {line}, column `{}`: {word:?} is no number{hint}", self.names[index])
            })?;
            self.digits[index].count(word, value);
            column.push(value);
        }
        Ok(())
    }

    /// The table of all rows.
    pub(super) fn table(self, frames: Vec<Rows>) -> Result<Table, String> {
        let Self { names, columns, digits } = self;
        let heads: Vec<_> = names.iter().map(|name| (name.as_str(), 1)).collect();
        let (arrays, incomplete) = join(&heads);
        if let Some(Incomplete { name, members }) = incomplete.first() {
            return Err(format!(
                "the {} column(s) {} are no complete vector or tensor `{name}`{}",
                members.len(),
                members.join(", "),
                columns_of(name)
            ));
        }
        Ok(Table { arrays, names, columns, digits, frames })
    }
}

/// The columns that would be complete, in words.
fn columns_of(name: &str) -> &'static str {
    match name {
        REFERENCE => {
            ": write X, Y (and Z in space), or of a body of revolution R, Z or R, theta, Z"
        }
        POINTS => ": write x, y (and z in space), or of a body of revolution r, z",
        "u" => ": write ux, uy or u1, u2, and uz or u3 in space and along R, theta, Z",
        "v" => ": write vx, vy or v1, v2, and vz or v3 in space and along R, theta, Z",
        "F" | "P" => {
            ", whose columns are numbered 11, 12, 21, 22, or 11, 12, 13, 21 and so on to 33"
        }
        _ => "",
    }
}

/// A limit that no table of particles reaches.
const MOST_COLUMNS: usize = 10_000;

/// The text with its header as the first line and a single separator between columns, and that separator.
///
/// `numpy.savetxt` writes the header as a comment, and blanks between columns by default.
fn prepared(bytes: &[u8]) -> Result<(Cow<'_, [u8]>, u8), String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let bytes = uncommented(bytes);
    let delimiter = delimiter(bytes)?;
    if delimiter != b' ' {
        return Ok((Cow::Borrowed(bytes), delimiter));
    }
    let mut spaced = Vec::with_capacity(bytes.len());
    for line in bytes.split(|byte| *byte == b'\n') {
        let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        for (index, word) in words.enumerate() {
            if index > 0 {
                spaced.push(b'\t');
            }
            spaced.extend_from_slice(word);
        }
        spaced.push(b'\n');
    }
    Ok((Cow::Owned(spaced), b'\t'))
}

/// The text from its header on, where the header is a comment: the last comment before a line that begins with a number.
fn uncommented(bytes: &[u8]) -> &[u8] {
    let mut comment = None;
    let mut at = 0;
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii();
        if let Some(header) = text.strip_prefix(b"#") {
            comment = Some(
                &bytes[at + line.len() - line.trim_ascii_start().len()
                    + (text.len() - header.len())..],
            );
        } else if !text.is_empty() {
            let end = text.iter().position(|byte| b",;\t ".contains(byte)).unwrap_or(text.len());
            let first = std::str::from_utf8(&text[..end]).unwrap_or_default();
            let is_number = number(first, b';').is_ok();
            return comment.filter(|_| is_number).unwrap_or(bytes);
        }
        at += line.len();
    }
    bytes
}

/// The separator of columns: comma, semicolon or tab, whichever the header has most often, else a blank.
fn delimiter(bytes: &[u8]) -> Result<u8, String> {
    let lines = bytes.split(|byte| *byte == b'\n');
    let header = lines.into_iter().find(|line| !line.trim_ascii().is_empty() && line[0] != b'#');
    let header = header.unwrap_or_default().trim_ascii();
    let count = |delimiter: u8| header.iter().filter(|byte| **byte == delimiter).count();
    // Of equal counts the last is taken, which is the comma.
    let (count, delimiter) = [b'\t', b';', b',']
        .map(|delimiter| (count(delimiter), delimiter))
        .into_iter()
        .max_by_key(|(count, _)| *count)
        .unwrap_or((0, b','));
    if count >= MOST_COLUMNS {
        return Err(format!("it has {} columns; at most {MOST_COLUMNS} are read", count + 1));
    }
    match count == 0 && !header.contains(&b'"') && header.contains(&b' ') {
        true => Ok(b' '),
        false => Ok(delimiter),
    }
}

/// A number with a decimal point, or with a decimal comma where commas do not separate columns; else the reason, as text for the
/// message.
fn number(word: &str, delimiter: u8) -> Result<f64, &'static str> {
    if let Ok(value) = word.parse() {
        return Ok(value);
    }
    if delimiter != b',' && word.contains(',') {
        return word.replacen(',', ".", 1).parse().map_err(|_| "");
    }
    // The whole line stands in one column.
    Err(match word.contains(';') {
        true => {
            "; columns are separated by the character that the header has: write the header with semicolons too"
        }
        false => "",
    })
}

/// The message of the reader, and the likeliest reason where lines have more columns than the header.
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

/// The significant digits of numbers, as they are written.
///
/// Multiples of a power of two, such as the coordinates of many grids, have few digits without any loss, and are left out.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Digits {
    /// Numbers with a fraction or an exponent.
    fractions: usize,
    /// The largest number of digits of a number.
    most: usize,
    /// How many numbers have the largest number of digits.
    longest: usize,
}

impl Digits {
    /// The number of fractions that tell the digits of all: fewer may be short by chance.
    const ENOUGH: usize = 8;
    /// Numbers with fewer digits are those of a grid, such as 0.05.
    const FEWEST: usize = 4;

    pub(super) fn count(&mut self, word: &str, value: f64) {
        let mantissa = word.split(['e', 'E', 'd', 'D']).next().unwrap_or_default();
        if !word.contains(['.', ',', 'e', 'E']) || is_whole(mantissa, value) {
            return;
        }
        let significant =
            mantissa.bytes().filter(u8::is_ascii_digit).skip_while(|digit| *digit == b'0').count();
        if significant == 0 {
            return;
        }
        self.fractions += 1;
        if significant > self.most {
            (self.most, self.longest) = (significant, 0);
        }
        self.longest += usize::from(significant == self.most);
    }

    /// The digits of the longest number, if enough numbers are known and half of them are as long: the numbers have then been cut.
    pub(super) fn most(self) -> Option<usize> {
        let is_cut = self.most >= Self::FEWEST && 2 * self.longest >= self.fractions;
        (self.fractions >= Self::ENOUGH && is_cut).then_some(self.most)
    }
}

/// Whether a number that ends with its last digit is a multiple of a power of two.
fn is_whole(mantissa: &str, value: f64) -> bool {
    const FINEST: f64 = 4_194_304.0;
    !mantissa.ends_with('0') && (value * FINEST).fract() == 0.0
}

/// Whether rows of all times are mixed: each particle has its rows together, or rows have no order. Where rows stand in long pieces,
/// and a time has two pieces, the file may hold two recordings.
fn is_mixed(times: &[f64]) -> bool {
    const SHORT: usize = 4;
    let pieces = times.chunk_by(|one, other| one.to_bits() == other.to_bits()).count();
    let different: HashSet<u64> = times.iter().map(|time| time.to_bits()).collect();
    pieces > different.len() && SHORT * pieces > times.len()
}

/// Cuts the rows into frames: successive rows with the same time.
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
                    "rows of time {time:?} do not stand together: sort the rows by time, unless two recordings are in the file"
                ));
            }
        }
    }
    if frames.is_empty() {
        frames.push(Rows { time: None, range: 0..0 });
    }
    Ok(frames)
}

/// Whether a path names a CSV file.
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
        assert_eq!(table.find("mass").map(|array| array.components.len()), Some(1));
        assert_eq!(table.floats("w", 0..1), None);
        let table = Table::read(b"x,node_1,node_3,S12\n1,2,3,4\n").unwrap();
        assert_eq!(table.floats("node_3", 0..1), Some(vec![3.0]));
        assert_eq!(table.floats("S12", 0..1), Some(vec![4.0]));
    }

    #[test]
    fn semicolons_and_tabs_separate_columns_and_leave_commas_for_decimals() {
        for text in [
            "x;y\n0,5;1.5\n",
            "x\ty\n0,5\t1,5\n",
            "x,y\n0.5,1.5\n",
            "x y\n 0.5  1.5\n",
            "# x,y\n0.5,1.5\n",
            "# made by hand\n# x y\n5e-1 1.5\n",
        ] {
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
            ("0.0625", None),
            ("0.0625000", Some(6)),
            ("0.05", None),
        ] {
            let table = table(word);
            assert_eq!(table.digits(&table.arrays[0]), expected, "{word}");
        }
    }

    #[test]
    fn more_columns_than_anybody_has_are_refused_by_their_header_alone() {
        let header = "a,".repeat(MOST_COLUMNS) + "b\n";
        let message = Table::read(header.as_bytes()).unwrap_err();
        assert!(message.contains("10001 columns; at most 10000"), "{message}");
    }

    #[test]
    fn rows_of_mixed_times_are_put_in_their_order() {
        let table = Table::read(b"t,id,x,y\n1,0,5,0\n0,0,4,0\n1,1,7,0\n0,1,6,0\n").unwrap();
        let times: Vec<_> = table.frames.iter().map(|rows| rows.time).collect();
        assert_eq!(times, [Some(0.0), Some(1.0)]);
        assert_eq!(table.floats(POINTS, 2..4), Some(vec![5.0, 0.0, 7.0, 0.0]));
        assert_eq!(table.integers("id", 0..2), Some(Ok(vec![0, 1])));
    }

    #[test]
    fn what_is_wrong_is_told() {
        let piece = |time: &str| format!("{time},1\n").repeat(9);
        let long_pieces = format!("t,x\n{}{}{}", piece("0"), piece("1"), piece("0"));
        for (text, expected) in [
            ("x,y\n1,z\n", "line 2, column `y`: \"z\""),
            ("x,y\n1\n", "fields"),
            ("x,z\n1,2\n", "no complete vector or tensor `Points`"),
            ("F11,F12,F21\n1,2,3\n", "no complete vector or tensor `F`"),
            (&long_pieces, "sort the rows by time, unless two recordings"),
            ("x,x\n0,1\n", "`x` stands twice"),
            ("t,x,t\n0,1,0\n", "`t` stands twice"),
            ("x,y\n0,5,1,5\n", "decimal commas? Write decimal points (0.5)"),
        ] {
            let message = Table::read(text.as_bytes()).expect_err(text);
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}
