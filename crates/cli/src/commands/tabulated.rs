//! A source and the table beside it, for fields that follow from histories.

use mmsmith_codegen::{Code, Tabulated};
use mmsmith_interpret::TableFile;

use crate::checksum::sha256;

/// Hexadecimal digits of the sign that a source and its table have in common.
const DIGITS_OF_DIGEST: usize = 16;

/// The code that reads a table, and the text of that table.
pub(super) fn beside<'a>(code: Code<'a>, file: &TableFile) -> (Code<'a>, String) {
    let digest = sha256(file.content())[..DIGITS_OF_DIGEST].to_owned();
    // After b and P, whose sizes sources know.
    let internal = file.fields.iter().skip(2);
    let table = Tabulated {
        digest: digest.clone(),
        end: file.end,
        error: file.error,
        sizes: internal.map(|field| field.shape.size(file.dimension)).collect(),
        variables: file.variables.clone(),
        in_time: file.in_time,
    };
    (code.with_table(table), file.text(&digest))
}
