//! Numbers as files hold them: kinds, byte orders, base64, zlib blocks.

use std::io::{self, Read};

use flate2::read::ZlibDecoder;

/// The largest number of values of an array: a gibibyte in double precision.
pub(super) const MOST_NUMBERS: usize = 1 << 27;

/// The kind of an array's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    F32,
    F64,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
}

impl Kind {
    /// The kind with this name in XML files.
    pub(super) fn of_xml(name: &str) -> Option<Self> {
        Some(match name {
            "Float32" => Self::F32,
            "Float64" => Self::F64,
            "Int8" => Self::I8,
            "UInt8" => Self::U8,
            "Int16" => Self::I16,
            "UInt16" => Self::U16,
            "Int32" => Self::I32,
            "UInt32" => Self::U32,
            "Int64" => Self::I64,
            "UInt64" => Self::U64,
            _ => return None,
        })
    }

    /// The kind with this name in legacy files, in any case: MATLAB scripts write `FLOAT`, and VTK reads it.
    pub(super) fn of_legacy(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "float" => Self::F32,
            "double" => Self::F64,
            "char" | "signed_char" => Self::I8,
            "unsigned_char" => Self::U8,
            "short" => Self::I16,
            "unsigned_short" => Self::U16,
            // VTK writes its own identities as 32 bits, however it was built.
            "int" | "vtkidtype" => Self::I32,
            "unsigned_int" => Self::U32,
            "long" | "long_long" | "vtktypeint64" => Self::I64,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Self::U64,
            _ => return None,
        })
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }

    pub(super) fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// The order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

/// A type into which numbers are read: whole numbers keep all their digits as `i64`.
pub(super) trait Number: Sized + Copy {
    fn decode(kind: Kind, order: ByteOrder, bytes: &[u8]) -> Result<Self, String>;
    fn parse(text: &str) -> Result<Self, String>;
}

/// The bits of a number, the least significant byte first.
fn bits(order: ByteOrder, bytes: &[u8]) -> u64 {
    let append = |bits: u64, byte: &u8| bits << 8 | u64::from(*byte);
    match order {
        ByteOrder::Big => bytes.iter().fold(0, append),
        ByteOrder::Little => bytes.iter().rev().fold(0, append),
    }
}

/// A whole number; `None` where it does not fit into 64 signed bits.
fn whole(kind: Kind, bits: u64) -> Option<i64> {
    let unused = 64 - 8 * kind.size() as u32;
    match kind {
        Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => Some((bits << unused) as i64 >> unused),
        _ => i64::try_from(bits).ok(),
    }
}

impl Number for f64 {
    fn decode(kind: Kind, order: ByteOrder, bytes: &[u8]) -> Result<Self, String> {
        let bits = bits(order, bytes);
        Ok(match kind {
            Kind::F64 => f64::from_bits(bits),
            Kind::F32 => f64::from(f32::from_bits(bits as u32)),
            Kind::U64 => bits as f64,
            _ => whole(kind, bits).map_or(f64::NAN, |whole| whole as f64),
        })
    }

    fn parse(text: &str) -> Result<Self, String> {
        text.parse().map_err(|_| format!("{text:?} is no number"))
    }
}

impl Number for i64 {
    fn decode(kind: Kind, order: ByteOrder, bytes: &[u8]) -> Result<Self, String> {
        if kind.is_whole() {
            let bits = bits(order, bytes);
            return whole(kind, bits).ok_or_else(|| format!("{bits} is too large"));
        }
        to_whole(f64::decode(kind, order, bytes)?)
    }

    fn parse(text: &str) -> Result<Self, String> {
        text.parse().or_else(|_| to_whole(f64::parse(text)?))
    }
}

/// Converts a float that stands for a whole number.
pub(super) fn to_whole(value: f64) -> Result<i64, String> {
    if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 {
        Ok(value as i64)
    } else {
        Err(format!("{value:?} is no whole number that a double holds exactly"))
    }
}

/// Converts a number to an index of a list.
pub(super) fn to_index(value: i64) -> Result<usize, String> {
    usize::try_from(value).map_err(|_| format!("{value} is no place in a list"))
}

/// All numbers of a payload, whose length must be right.
pub(super) fn decode<N: Number>(
    bytes: &[u8],
    kind: Kind,
    order: ByteOrder,
) -> Result<Vec<N>, String> {
    bytes.chunks_exact(kind.size()).map(|chunk| N::decode(kind, order, chunk)).collect()
}

/// Exactly `expected` numbers between blanks.
pub(super) fn parse<N: Number>(text: &[u8], expected: usize) -> Result<Vec<N>, String> {
    let words = text.split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty());
    // A number and the blank behind it take two bytes at least.
    let mut numbers = Vec::with_capacity(expected.min(text.len() / 2 + 1));
    let mut found = 0_usize;
    for word in words {
        found += 1;
        if found <= expected {
            let word = std::str::from_utf8(word).map_err(|_| "it holds bytes that are no text")?;
            numbers.push(N::parse(word)?);
        }
    }
    if found != expected {
        return Err(format!("it holds {found} numbers; its size says {expected}"));
    }
    Ok(numbers)
}

/// The bytes behind base64 text. Padding inside the text ends a group, not the text: headers may be encoded apart.
pub(super) struct Base64<'a> {
    text: &'a [u8],
    ready: [u8; 3],
    /// The start of the part of `ready` that was not handed out yet.
    from: usize,
    to: usize,
}

impl<'a> Base64<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { text, ready: [0; 3], from: 0, to: 0 }
    }

    /// Decodes the next four digits; false at the end.
    fn refill(&mut self) -> io::Result<bool> {
        let bad = |message: String| io::Error::new(io::ErrorKind::InvalidData, message);
        let (mut bits, mut digits, mut padding) = (0_u32, 0, 0);
        while digits + padding < 4 {
            let Some((&byte, rest)) = self.text.split_first() else {
                if digits + padding == 0 {
                    return Ok(false);
                }
                return Err(bad("the base64 text ends in the middle of a group".into()));
            };
            self.text = rest;
            let digit = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' if digits >= 2 => {
                    padding += 1;
                    continue;
                }
                byte if byte.is_ascii_whitespace() => continue,
                byte => return Err(bad(format!("{:?} is no base64", char::from(byte)))),
            };
            if padding > 0 {
                return Err(bad("a base64 digit follows the padding".into()));
            }
            bits = bits << 6 | u32::from(digit);
            digits += 1;
        }
        bits <<= 6 * padding;
        self.ready = [(bits >> 16) as u8, (bits >> 8) as u8, bits as u8];
        (self.from, self.to) = (0, 3 - padding as usize);
        Ok(true)
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut done = 0;
        while done < buffer.len() {
            if self.from == self.to && !self.refill()? {
                break;
            }
            buffer[done] = self.ready[self.from];
            self.from += 1;
            done += 1;
        }
        Ok(done)
    }
}

/// How binary data of an XML file begins and whether it is compressed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packing {
    /// Bytes of a number in a header: 4 or 8.
    pub(super) header: usize,
    pub(super) order: ByteOrder,
    pub(super) zlib: bool,
}

impl Packing {
    /// The `expected` bytes of an array, from a source of at most `available` bytes that begins with its header.
    pub(super) fn unpack(
        self,
        mut source: impl Read,
        available: usize,
        expected: usize,
    ) -> Result<Vec<u8>, String> {
        if self.zlib {
            return self.inflate(source, expected);
        }
        let declared = self.header_number(&mut source)?;
        if declared != expected as u64 {
            return Err(format!("its header promises {declared} bytes; its size says {expected}"));
        }
        if expected > available {
            return Err(format!(
                "its header promises {expected} bytes; at most {available} are there"
            ));
        }
        let mut bytes = vec![0; expected];
        source.read_exact(&mut bytes).map_err(|cause| cut(&cause, expected))?;
        Ok(bytes)
    }

    fn header_number(self, source: &mut impl Read) -> Result<u64, String> {
        let mut bytes = [0; 8];
        let bytes = &mut bytes[..self.header];
        source.read_exact(bytes).map_err(|cause| match cause.kind() {
            io::ErrorKind::UnexpectedEof => "its data end before their header does".to_owned(),
            _ => cause.to_string(),
        })?;
        Ok(bits(self.order, bytes))
    }

    /// Zlib blocks: their number, the size of all but the last, the size of the last if it is shorter, the packed
    /// sizes; then the blocks.
    fn inflate(self, mut source: impl Read, expected: usize) -> Result<Vec<u8>, String> {
        let blocks = self.header_number(&mut source)?;
        if blocks == 0 {
            return match expected {
                0 => Ok(vec![]),
                _ => Err(format!("its header promises no block; its size says {expected} bytes")),
            };
        }
        let full = self.header_number(&mut source)?;
        let last = match self.header_number(&mut source)? {
            0 => full,
            partial => partial,
        };
        let declared = u128::from(blocks - 1) * u128::from(full) + u128::from(last);
        if declared != expected as u128 {
            return Err(format!("its header promises {declared} bytes; its size says {expected}"));
        }
        // Memory grows with the bytes that are read, not with the bytes that are promised.
        let mut packed = vec![];
        for _ in 0..blocks {
            packed.push(self.header_number(&mut source)?);
        }
        let mut bytes = vec![];
        for (index, packed) in packed.iter().enumerate() {
            let size = if index as u64 + 1 == blocks { last } else { full };
            let mut block = vec![];
            source
                .by_ref()
                .take(*packed)
                .read_to_end(&mut block)
                .map_err(|cause| cause.to_string())?;
            if block.len() as u64 != *packed {
                return Err(format!(
                    "block {} of {blocks} has {} of its {packed} packed bytes",
                    index + 1,
                    block.len()
                ));
            }
            let before = bytes.len();
            // A further byte shows that the block is longer than promised.
            ZlibDecoder::new(&block[..]).take(size + 1).read_to_end(&mut bytes).map_err(
                |cause| format!("block {} of {blocks} does not inflate: {cause}", index + 1),
            )?;
            if (bytes.len() - before) as u64 != size {
                return Err(format!(
                    "block {} of {blocks} does not inflate to the {size} bytes that its header promises",
                    index + 1
                ));
            }
        }
        Ok(bytes)
    }
}

fn cut(cause: &io::Error, expected: usize) -> String {
    match cause.kind() {
        io::ErrorKind::UnexpectedEof => {
            format!("its header promises {expected} bytes; its data end before that")
        }
        _ => cause.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base64(text: &str) -> io::Result<Vec<u8>> {
        let mut bytes = vec![];
        Base64::new(text.as_bytes()).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    #[test]
    fn base64_goes_on_behind_padding_and_refuses_what_is_none() {
        assert_eq!(base64("").unwrap(), b"");
        assert_eq!(base64("TWFu\n TQ==TWE=").unwrap(), b"ManMMa");
        for text in ["T", "TQ=", "TQ=T", "T===", "TW!u", "=", "TQ=a"] {
            assert!(base64(text).is_err(), "{text}");
        }
    }

    #[test]
    fn every_kind_is_decoded_in_both_orders() {
        for (kind, bytes, value) in [
            (Kind::I8, &[0xff][..], -1.0),
            (Kind::U8, &[0xff], 255.0),
            (Kind::I16, &[0xff, 0xfe], -2.0),
            (Kind::U16, &[1, 0], 256.0),
            (Kind::I32, &[0xff, 0xff, 0xff, 0xfd], -3.0),
            (Kind::U32, &[0x80, 0, 0, 0], 2_147_483_648.0),
            (Kind::I64, &[0xff; 8], -1.0),
            (Kind::U64, &[0xff; 8], 18_446_744_073_709_551_615.0),
            (Kind::F32, &[0xbf, 0x80, 0, 0], -1.0),
            (Kind::F64, &[0x3f, 0xf0, 0, 0, 0, 0, 0, 0], 1.0),
        ] {
            assert_eq!(f64::decode(kind, ByteOrder::Big, bytes), Ok(value), "{kind:?}");
            let reversed: Vec<u8> = bytes.iter().rev().copied().collect();
            assert_eq!(f64::decode(kind, ByteOrder::Little, &reversed), Ok(value), "{kind:?}");
        }
        let large = 9_007_199_254_740_993_i64;
        assert_eq!(i64::decode(Kind::U64, ByteOrder::Big, &large.to_be_bytes()), Ok(large));
        assert_eq!(i64::parse("9007199254740993"), Ok(large));
        assert_eq!(i64::parse("17.0"), Ok(17));
        assert!(i64::parse("0.5").is_err() && i64::parse("nan").is_err());
        assert!(i64::decode(Kind::U64, ByteOrder::Big, &[0xff; 8]).is_err());
    }

    #[test]
    fn ascii_must_have_the_promised_count() {
        assert_eq!(parse::<f64>(b" 1 -2e3\n3 ", 3), Ok(vec![1.0, -2e3, 3.0]));
        assert!(parse::<f64>(b"1 2", 3).unwrap_err().contains("2 numbers; its size says 3"));
        assert!(parse::<f64>(b"1 2 3 4", 3).unwrap_err().contains("4 numbers"));
        assert!(parse::<f64>(b"1 x 3", 3).unwrap_err().contains("\"x\""));
        assert!(parse::<f64>(b"", usize::MAX).is_err());
    }
}
