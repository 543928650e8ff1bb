//! Arrays as NumPy reads them (NEP 1, version 1.0 of the format).

use std::fmt::Write;

/// The file of an array of doubles with the given shape, values in row-major order.
pub(crate) fn bytes(shape: &[usize], values: impl Iterator<Item = f64>) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";
    /// Data begin at a multiple of this.
    const ALIGNMENT: usize = 64;
    let mut extents = String::new();
    for extent in shape {
        // Writing to a string cannot fail. A tuple of one ends with a comma.
        let _ = write!(extents, "{extent}, ");
    }
    let mut header =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}", extents.trim_end());
    let before = MAGIC.len() + size_of::<u16>();
    let padding =
        (before + header.len() + 1).next_multiple_of(ALIGNMENT) - before - header.len() - 1;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    let mut bytes = MAGIC.to_vec();
    // A dozen extents take some hundred characters.
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.flat_map(f64::to_le_bytes));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_tells_the_shape_and_data_are_aligned() {
        let file = bytes(&[2], [1.0, -2.5].into_iter());
        assert_eq!(file.len(), 128 + 16);
        assert_eq!(&file[..10], b"\x93NUMPY\x01\x00\x76\x00");
        let header = std::str::from_utf8(&file[10..128]).unwrap();
        assert!(
            header.starts_with("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }"),
            "{header}"
        );
        assert!(header.ends_with(" \n"));
        assert_eq!(file[128..136], 1.0_f64.to_le_bytes());
        let matrix = bytes(&[3, 2, 2], (0..12).map(f64::from));
        assert_eq!(matrix.len() % 64, 12 * 8 % 64);
        assert!(String::from_utf8_lossy(&matrix).contains("'shape': (3, 2, 2,), }"));
    }
}
