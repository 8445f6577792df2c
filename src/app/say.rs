//! What a command answers, on standard output.

use std::io::Write;

/// Writes `text` and a line's end. That nobody reads on, as after `palpate scenes | head -1`, is no fault of the command.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}
