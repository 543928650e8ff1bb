//! Text inside HTML.

use std::fmt::Write;

use crate::svg::escape;

/// `text` inside an element, with numbers that no line may break: browsers break `3.4e-2` after its hyphen.
pub(crate) fn text(text: &str) -> String {
    let mut html = String::new();
    for word in text.split_inclusive(char::is_whitespace) {
        if is_number(word) {
            let bare = word.trim_end();
            let _ = write!(
                html,
                "<span class=\"nowrap\">{}</span>{}",
                escape(bare),
                &word[bare.len()..]
            );
        } else {
            html += &escape(word);
        }
    }
    html
}

/// Whether a word is a number that has a hyphen, whatever punctuation stands around it.
fn is_number(word: &str) -> bool {
    let bare = word.trim_matches(|c: char| !(c.is_ascii_digit() || c == '-'));
    bare.contains('-') && bare.parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_do_not_break_and_text_cannot_leave_its_place() {
        assert_eq!(
            text("from -1.0e-3 to 2, (4e-5); a-b <x>"),
            "from <span class=\"nowrap\">-1.0e-3</span> to 2, <span class=\"nowrap\">(4e-5);</span> \
             a-b &lt;x&gt;"
        );
        assert_eq!(text("- 1"), "- 1");
    }
}
