//! JSON as programs write it: numbers that are none, and poses that are lost.

use super::error::{DepthFileError, io_error};
use crate::{regular_file, text};
use glam::DMat4;
use isv_volume::{CameraPose, DepthError};
use serde::de::{Deserialize, DeserializeOwned, Deserializer, Visitor};
use serde_json::Value;
use std::fmt;
use std::path::Path;

/// Reads a JSON file.
pub(crate) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DepthFileError> {
    let bytes = regular_file::read(file).map_err(io_error(file))?;
    let mut bytes = text::decode(&bytes).into_owned();
    blank_non_finite(&mut bytes);
    serde_json::from_slice(&bytes).map_err(|why| DepthFileError::Json { path: file.to_owned(), why })
}

/// Replaces each number that JSON has no word for, such as `NaN` or `-Infinity`, with an empty string of the same length.
///
/// Python, NumPy and C write such words, and parsers refuse the whole file for one. Text in quotes stays as it is, and lines and
/// columns stay where they are. [`Number`] takes an empty string for NaN.
fn blank_non_finite(bytes: &mut [u8]) {
    let mut at = 0;
    while at < bytes.len() {
        if bytes[at] == b'"' {
            at = end_of_string(bytes, at);
            continue;
        }
        let token = bytes[at..].iter().take_while(|b| is_of_token(**b)).count();
        if is_non_finite(&bytes[at..at + token]) {
            bytes[at..at + token].fill(b' ');
            bytes[at..at + 2].fill(b'"');
        }
        at += token.max(1);
    }
}

/// The place after the string that begins at a quotation mark.
fn end_of_string(bytes: &[u8], start: usize) -> usize {
    let mut at = start + 1;
    while at < bytes.len() && bytes[at] != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    (at + 1).min(bytes.len())
}

fn is_of_token(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || b"+-.#()_".contains(&byte)
}

/// Whether a word stands for a number that is not finite.
///
/// `1.#INF`, `-1.#IND` and `-nan(ind)` are what Microsoft's C libraries print. A number that a double cannot hold, such as 1e999, is
/// infinite too.
fn is_non_finite(token: &[u8]) -> bool {
    // Most tokens are plain decimals.
    if !token.iter().any(|b| b.is_ascii_alphabetic() || *b == b'#') {
        return false;
    }
    let Ok(token) = std::str::from_utf8(token) else { return false };
    let token = token.to_ascii_lowercase();
    let word = token.strip_prefix(['-', '+']).unwrap_or(&token);
    matches!(word, "nan" | "inf" | "infinity")
        || (word.starts_with("nan(") && word.ends_with(')'))
        || word.starts_with("1.#")
        || (word.starts_with(|c: char| c.is_ascii_digit()) && word.parse() == Ok(f64::INFINITY))
}

/// A number, or NaN for `null`, for what stands in place of a number that is not finite, and for text that is no number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Number(pub(crate) f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor)
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = Number;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number")
    }

    fn visit_f64<E>(self, value: f64) -> Result<Number, E> {
        Ok(Number(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_unit<E>(self) -> Result<Number, E> {
        Ok(Number(f64::NAN))
    }

    fn visit_str<E>(self, text: &str) -> Result<Number, E> {
        Ok(Number(text.trim().parse().unwrap_or(f64::NAN)))
    }
}

/// A 4x4 matrix as nested lists, row after row; or why what stands in its place is none. Whatever that is, it is no error of the
/// file: one lost pose costs one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrittenPose(Result<[[f64; 4]; 4], &'static str>);

const NO_MATRIX: &str = "it is not 4 rows of 4 numbers";

impl WrittenPose {
    /// The pose, from the camera to the world.
    pub(crate) fn pose(&self) -> Result<CameraPose, DepthError> {
        let rows = self.0.map_err(|why| DepthError::Pose { why })?;
        CameraPose::from_matrix(DMat4::from_cols_array_2d(&rows).transpose())
    }
}

impl<'de> Deserialize<'de> for WrittenPose {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let four = |value: &Value| -> Option<[Value; 4]> { value.as_array()?.clone().try_into().ok() };
        let matrix = || {
            let mut matrix = [[0.0; 4]; 4];
            for (to, row) in matrix.iter_mut().zip(four(&value)?) {
                // What is no number is a number that is not known.
                *to = four(&row)?
                    .map(|entry| serde_json::from_value(entry).map_or(f64::NAN, |Number(number)| number));
            }
            Some(matrix)
        };
        Ok(Self(matrix().ok_or(NO_MATRIX)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blanked(text: &str) -> String {
        let mut bytes = text.as_bytes().to_vec();
        blank_non_finite(&mut bytes);
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn words_for_what_is_no_number_become_empty_strings_of_their_length() {
        for word in [
            "NaN",
            "nan",
            "-nan",
            "NAN",
            "Infinity",
            "-Infinity",
            "+Infinity",
            "inf",
            "-inf",
            "INF",
            "1.#INF",
            "-1.#IND",
            "1.#QNAN0",
            "-nan(ind)",
            "1e999",
            "-1E+400",
        ] {
            let expected = format!("[1.5,\"\"{},-2e-3]", " ".repeat(word.len() - 2));
            assert_eq!(blanked(&format!("[1.5,{word},-2e-3]")), expected);
        }
    }

    #[test]
    fn everything_else_stays_as_it_is() {
        for text in [
            r#"{"NaN": "NaN", "a\"NaN": [true, false, null, 1e308, -0.5E-7, 1e-999]}"#,
            r#"["\\", "-Infinity \" NaN"]"#,
            "[nano, infinite, i, n]",
            r#"["NaN"#,
            r#"["\"#,
            "",
        ] {
            assert_eq!(blanked(text), text);
        }
    }

    #[test]
    fn whatever_is_no_matrix_is_a_pose_that_is_none() {
        let sound = "[[1, 0, 0, \"0.5\"], [0, 1, 0, -2], [0, 0, 1e0, 3], [0, 0, 0, 1]]";
        let WrittenPose(rows) = serde_json::from_str(sound).unwrap();
        assert_eq!(rows.unwrap()[0], [1.0, 0.0, 0.0, 0.5]);
        for text in [
            "null",
            "true",
            "7",
            "-7",
            "0.5",
            "\"lost\"",
            "{\"a\": [1]}",
            "[]",
            "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]",
            "[[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]",
            "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1, 0]]",
            "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], []]",
            "[[1, 0, 0, 0], null, [0, 0, 1, 0], [0, 0, 0, 1]]",
            "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]",
        ] {
            let WrittenPose(rows) = serde_json::from_str(text).unwrap();
            assert_eq!(rows, Err(NO_MATRIX), "{text}");
        }
        for cell in ["null", "\"nan\"", "[1, [2]]", "{\"a\": 1}", "true"] {
            let text = sound.replacen("-2", cell, 1);
            let WrittenPose(rows) = serde_json::from_str(&text).unwrap();
            assert!(rows.unwrap()[1][3].is_nan(), "{text}");
        }
    }
}
