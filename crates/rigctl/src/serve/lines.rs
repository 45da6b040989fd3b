//! Lines of bounded length from a client, whatever it sends.

use std::io::{self, BufRead, Read};

/// Longest line of a client (bytes, without its end). The longest order that makes sense has about 150.
pub const LONGEST: usize = 4096;

/// What came up to the end of a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Line {
    /// A line without its end.
    Whole(Vec<u8>),
    /// More than [`LONGEST`] bytes, which are gone.
    TooLong,
}

/// Reads up to the next line end. `None` is the end of the input; a last line without a line end was cut and is dropped.
///
/// # Errors
/// If the input fails.
pub fn next(input: &mut impl BufRead) -> io::Result<Option<Line>> {
    let mut line = Vec::new();
    Read::by_ref(input).take(LONGEST as u64 + 1).read_until(b'\n', &mut line)?;
    if line.pop_if(|byte| *byte == b'\n').is_some() {
        return Ok(Some(Line::Whole(line)));
    }
    Ok((line.len() > LONGEST && input.skip_until(b'\n')? > 0).then_some(Line::TooLong))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::BufReader;

    #[test]
    fn lines_are_bounded_and_a_long_one_loses_only_itself() {
        let long = "x".repeat(LONGEST + 1);
        let fits = "y".repeat(LONGEST);
        let text = format!("one\n\n{long}\n{fits}\n{}\ntwo\nthree without an end", long.repeat(100));
        // A buffer smaller than a line, so that lines come in pieces.
        let mut input = BufReader::with_capacity(7, text.as_bytes());
        let mut lines = Vec::new();
        while let Some(line) = next(&mut input).expect("text") {
            lines.push(line);
        }
        let whole = |text: &str| Line::Whole(text.into());
        assert_eq!(lines, [whole("one"), whole(""), Line::TooLong, whole(&fits), Line::TooLong, whole("two")]);
    }
}
