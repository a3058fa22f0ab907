//! Paragraphs and sentences of documents, of doc comments and of the words of errors.

/// Most words of a sentence.
const MOST_WORDS: usize = 25;

/// A paragraph of prose.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Paragraph {
    /// Number of the first line in the file, from 1.
    pub(super) line: usize,
    /// Lines, joined by spaces.
    pub(super) text: String,
    /// Whether it is the first one of a comment or of a document.
    pub(super) begins: bool,
}

/// Paragraphs of a document: without headings, tables, code and pictures; each item of a list is one.
pub(super) fn markdown(text: &str) -> Vec<Paragraph> {
    paragraphs(text.lines().enumerate().map(|(number, line)| (number + 1, line)))
}

/// Paragraphs of a Rust file's doc comments, and the words of its errors.
pub(super) fn rust(text: &str) -> Vec<Paragraph> {
    let mut found = Vec::new();
    let mut comment: Vec<(usize, &str)> = Vec::new();
    // Whether the words of an error begin in the next line.
    let mut opened = false;
    for (number, line) in text.lines().chain([""]).enumerate() {
        let line = line.trim_start();
        let words = line.strip_prefix("///").or_else(|| line.strip_prefix("//!"));
        if let Some(words) = words.filter(|words| !words.starts_with('/')) {
            comment.push((number + 1, words.strip_prefix(' ').unwrap_or(words)));
            continue;
        }
        found.extend(paragraphs(comment.drain(..)));
        let quoted = line.strip_prefix("#[error(").or(opened.then_some(line)).map(str::trim_start);
        opened = quoted == Some("");
        if let Some(words) = quoted.and_then(|rest| rest.strip_prefix('"')) {
            let words = words.replace("\\\"", "'");
            let words = words.split('"').next().unwrap_or_default().to_owned();
            found.push(Paragraph { line: number + 1, text: words, begins: false });
        }
    }
    found
}

fn paragraphs<'a>(lines: impl Iterator<Item = (usize, &'a str)>) -> Vec<Paragraph> {
    let mut found: Vec<Paragraph> = Vec::new();
    let (mut open, mut in_code) = (false, false);
    for (line, text) in lines {
        let text = text.trim();
        if text.starts_with("```") {
            (in_code, open) = (!in_code, false);
            continue;
        }
        let is_definition = text.starts_with('[') && text.contains("]: ");
        if in_code || text.is_empty() || text.starts_with(['#', '|', '!', '<']) || is_definition {
            open = false;
            continue;
        }
        let item = item_text(text);
        if item.is_some() {
            open = false;
        }
        let text = item.unwrap_or(text).trim_start_matches("> ");
        match found.last_mut().filter(|_| open) {
            Some(paragraph) => {
                paragraph.text.push(' ');
                paragraph.text.push_str(text);
            }
            None => found.push(Paragraph { line, text: text.to_owned(), begins: found.is_empty() }),
        }
        open = true;
    }
    found
}

/// The text of an item of a list.
fn item_text(line: &str) -> Option<&str> {
    let bulleted = line.strip_prefix("- ").or_else(|| line.strip_prefix("* "));
    bulleted.or_else(|| {
        let rest = line.trim_start_matches(|c: char| c.is_ascii_digit());
        (rest.len() < line.len()).then(|| rest.strip_prefix(". ")).flatten()
    })
}

/// The sentences of a paragraph. A full stop within one, as in "Eq. 9", has no capital letter behind it, nor the name of the project.
pub(super) fn sentences(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = Some(text);
    std::iter::from_fn(move || {
        let text = rest?;
        let ends = text.match_indices(['.', '?', '!']).map(|(at, _)| at + 1);
        let mut ends = ends.map(|end| end + usize::from(text[end..].starts_with(')')));
        let end = ends.find(|end| {
            let next = text[*end..].strip_prefix(' ').map(str::trim_start).unwrap_or_default();
            next.starts_with(|first: char| first.is_uppercase() || "`[*\"".contains(first))
                || next.starts_with("isv ")
        });
        rest = end.map(|end| text[end..].trim_start());
        Some(&text[..end.unwrap_or(text.len())])
    })
}

/// Whether a sentence has too many words. Code between backticks is one word, and the address of a link none.
pub(super) fn is_long(sentence: &str) -> bool {
    let mut words = String::new();
    for (part, text) in sentence.split('`').enumerate() {
        words.push_str(if part % 2 == 0 { text } else { "code" });
    }
    while let Some(at) = words.find("](") {
        let end = words[at..].find(')').map_or(words.len(), |end| at + end + 1);
        words.replace_range(at..end, " ");
    }
    words.split_whitespace().filter(|word| word.contains(char::is_alphanumeric)).count() > MOST_WORDS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn documents_have_paragraphs() {
        let text = "# Title\n\nOne\nline.\n- An item\n  of two lines.\n2. Another.\n\n```sh\nnot this\n```\n| a | b |\nEnd.\n";
        let found: Vec<_> = markdown(text).into_iter().map(|p| (p.line, p.text)).collect();
        let expected = [(3, "One line."), (5, "An item of two lines."), (7, "Another."), (13, "End.")];
        assert_eq!(found, expected.map(|(line, text)| (line, text.to_owned())));
    }

    #[test]
    fn comments_have_paragraphs() {
        let text = "//! A file.\n\n/// A thing.\n///\n/// More of it.\nstruct A;\n    #[error(\"no {0}\")]\n#[error(\n    \"a \\\"b\\\" c\"\n)]\n";
        let found: Vec<_> = rust(text).into_iter().map(|p| (p.line, p.text, p.begins)).collect();
        let expected = [
            (1, "A file.", true),
            (3, "A thing.", true),
            (5, "More of it.", false),
            (7, "no {0}", false),
            (9, "a 'b' c", false),
        ];
        assert_eq!(found, expected.map(|(line, text, begins)| (line, text.to_owned(), begins)));
    }

    #[test]
    fn sentences_end_before_capital_letters() {
        let found: Vec<_> = sentences("As Eq. 9 says, 1.5 voxels. (So it is.) `Code` begins one.").collect();
        assert_eq!(found, ["As Eq. 9 says, 1.5 voxels. (So it is.)", "`Code` begins one."]);
        assert_eq!(sentences("Is it? Yes! No. isv says so.").count(), 4);
    }

    #[test]
    fn words_are_counted() {
        let words = |count: usize| "word ".repeat(count);
        assert!(!is_long(&words(25)) && is_long(&words(26)));
        assert!(!is_long(&format!("{} `some code of many words` - ", words(24))));
        assert!(!is_long(&format!("{}[link](an address of words)", words(24))));
    }
}
