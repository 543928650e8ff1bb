//! The form of a line.

use serde_json::Value;
use sha2::{Digest, Sha256};

/// Text before the checksum, and text between the checksum and the content.
const BEFORE: &str = "{\"sha256\":\"";
const AFTER: &str = "\",";
/// Hexadecimal digits of the checksum; one damaged line in 10^19 passes for a whole one.
const DIGITS: usize = 16;

/// The last line has no end: its writer was killed, or the disk was full.
pub(crate) const TORN: &str = "the line is cut short";
/// The line has another form, which it names: `{"format":2,...`. Lines of this version have none.
pub(crate) const LATER: &str = "the line has the form of a later version";
const LATER_BEGINS: &[u8] = b"{\"format\":";
const NO_CASE: &str = "this is not the line of a case: it does not start with a checksum";
const WRONG_SUM: &str = "the checksum does not fit the line";
const NO_KEY: &str = "the line has no key or no value";

/// The line of a case, with its end.
pub(crate) fn write(key: &str, value: &Value) -> String {
    let content = format!("\"key\":{key},\"value\":{value}}}");
    format!("{BEFORE}{}{AFTER}{content}\n", sum(content.as_bytes()))
}

/// Key and value of a line without its end, or the fault of the line.
pub(crate) fn read(line: &[u8]) -> Result<(String, Value), &'static str> {
    if line.starts_with(LATER_BEGINS) {
        return Err(LATER);
    }
    let rest = line.strip_prefix(BEFORE.as_bytes()).ok_or(NO_CASE)?;
    let (found, rest) = rest.split_at_checked(DIGITS).ok_or(NO_CASE)?;
    let content = rest.strip_prefix(AFTER.as_bytes()).ok_or(NO_CASE)?;
    if found != sum(content).as_bytes() {
        return Err(WRONG_SUM);
    }
    let mut case: Value = serde_json::from_slice(line).map_err(|_| NO_KEY)?;
    match (case.get("key").map(canonical), case.get_mut("value")) {
        (Some(key), Some(value)) => Ok((key, value.take())),
        _ => Err(NO_KEY),
    }
}

/// A short checksum in hexadecimal digits.
pub(crate) fn sum(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().take(DIGITS / 2).map(|byte| format!("{byte:02x}")).collect()
}

/// `value` as JSON without spaces, with the members of objects sorted by name, so that equal contents have equal texts.
#[must_use]
pub fn canonical(value: &Value) -> String {
    match value {
        Value::Array(entries) => {
            let entries: Vec<_> = entries.iter().map(canonical).collect();
            format!("[{}]", entries.join(","))
        }
        Value::Object(members) => {
            let mut members: Vec<_> = members.iter().collect();
            members.sort_by_key(|(name, _)| *name);
            let members = members.into_iter().map(|(name, value)| {
                format!("{}:{}", Value::from(name.as_str()), canonical(value))
            });
            format!("{{{}}}", members.collect::<Vec<_>>().join(","))
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_line_is_read_as_it_was_written() {
        let key = json!({ "b": [1, 2.5, null], "a": { "y": "\u{7}\n\"", "x": 1e-14 } });
        let value = json!({ "error": 0.1 + 0.2, "count": u64::MAX, "status": "ok" });
        let text = write(&canonical(&key), &value);
        assert_eq!(text.matches('\n').count(), 1);
        assert_eq!(read(text.trim_end().as_bytes()), Ok((canonical(&key), value)));
        assert!(canonical(&key).starts_with("{\"a\":{\"x\":1e-14,\"y\":"), "{}", canonical(&key));
    }

    #[test]
    fn any_changed_byte_is_noticed() {
        let line = write("{\"a\":1}", &json!(2.5));
        let line = line.trim_end().as_bytes();
        for place in 0..line.len() {
            for bit in [1, 0x80] {
                let mut changed = line.to_vec();
                changed[place] ^= bit;
                assert!(read(&changed).is_err(), "byte {place}");
            }
            assert!(read(&line[..place]).is_err(), "cut at {place}");
        }
    }
}
