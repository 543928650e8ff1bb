//! Text files of people, read with a limit.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use thiserror::Error;

/// The longest specification, and the longest listing beside one, in bytes.
pub const LONGEST_FILE: usize = 4 << 20;

/// Why there is no text.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The file cannot be read, or is no text.
    #[error(transparent)]
    File(#[from] io::Error),
    /// The file goes on beyond the limit, perhaps for ever.
    #[error("longer than {most} bytes, which are the limit")]
    TooLong {
        /// The limit in bytes.
        most: usize,
    },
}

/// The text of the file at `path`, of which no more than `most` bytes and one are read.
///
/// # Errors
///
/// [`ReadError`] where the file cannot be read, is longer, or is not UTF-8.
pub fn read_text(path: &Path, most: usize) -> Result<String, ReadError> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > most {
        return Err(ReadError::TooLong { most });
    }
    String::from_utf8(bytes).map_err(|e| {
        let place = e.utf8_error().valid_up_to();
        let message = format!("byte {place} is no UTF-8 text");
        ReadError::File(io::Error::new(io::ErrorKind::InvalidData, message))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_much_as_the_limit_is_read_and_no_more() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/read.rs");
        let whole = std::fs::read_to_string(&here).unwrap();
        assert_eq!(read_text(&here, whole.len()).unwrap(), whole);
        let error = read_text(&here, whole.len() - 1).unwrap_err();
        assert!(matches!(error, ReadError::TooLong { most } if most == whole.len() - 1));
        assert!(matches!(read_text(Path::new("nowhere.toml"), 9), Err(ReadError::File(_))));
    }

    #[test]
    #[cfg(unix)]
    fn a_file_without_end_is_left_at_the_limit() {
        let error = read_text(Path::new("/dev/zero"), 1000).unwrap_err();
        assert_eq!(error.to_string(), "longer than 1000 bytes, which are the limit");
    }
}
