//! Words of a Radiance scene file, each with its line and column.

use std::path::Path;

use crate::base::Place;

/// A word of a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Word<'a> {
    pub text: &'a str,
    /// Line, from 1.
    pub line: u32,
    /// Where it begins, in bytes of the file.
    at: usize,
    /// Where its line begins.
    line_at: usize,
    /// Whether it is the first of its line.
    pub leads: bool,
}

/// Splits a scene file into words; skips comments.
#[derive(Clone)]
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
    line: u32,
    line_at: usize,
    fresh: bool,
}

impl<'a> Lexer<'a> {
    pub fn new(text: &'a str) -> Self {
        Self { text, at: 0, line: 1, line_at: 0, fresh: true }
    }

    /// The next word. One that begins with a quote runs to the same quote on its line.
    pub fn word(&mut self) -> Option<Word<'a>> {
        let bytes = self.text.as_bytes();
        loop {
            match bytes.get(self.at)? {
                b'\n' => {
                    self.line += 1;
                    self.fresh = true;
                    self.at += 1;
                    self.line_at = self.at;
                }
                b'#' => {
                    self.skip_line();
                }
                // Radiance's isspace(): tabs, carriage returns, form feeds.
                b' ' | b'\t' | b'\r' | 0x0b | 0x0c => self.at += 1,
                _ => break,
            }
        }
        let Self { at, line, line_at, fresh: leads, .. } = *self;
        self.fresh = false;
        let rest = &bytes[at..];
        if let quote @ (b'"' | b'\'') = rest[0] {
            let end = rest[1..].iter().position(|&b| b == quote || b == b'\n');
            if let Some(end) = end.filter(|&end| rest[1 + end] == quote) {
                self.at = at + end + 2;
                return Some(Word {
                    text: &self.text[at + 1..at + 1 + end],
                    line,
                    at,
                    line_at,
                    leads,
                });
            }
        }
        let length = rest.iter().position(|b| b.is_ascii_whitespace() || *b == 0x0b);
        self.at = at + length.unwrap_or(rest.len());
        Some(Word { text: &self.text[at..self.at], line, at, line_at, leads })
    }

    /// The next word, which stays.
    pub fn peek(&self) -> Option<Word<'a>> {
        self.clone().word()
    }

    /// Skips to the end of the line, and of those that it continues on with a backslash; returns
    /// what was skipped.
    pub fn skip_line(&mut self) -> &'a str {
        let bytes = self.text.as_bytes();
        let from = self.at;
        let mut continues = false;
        while let Some(&byte) = bytes.get(self.at) {
            if byte == b'\n' {
                if !continues || bytes[from] == b'#' {
                    break;
                }
                self.line += 1;
            }
            continues = byte == b'\\' || (continues && byte == b'\r');
            self.at += 1;
        }
        &self.text[from..self.at]
    }

    /// Where a word stands.
    pub fn place(&self, file: &Path, word: Word<'_>, item: &str) -> Place {
        // Characters, but bytes on a line that no person wrote: counting them for every primitive
        // would take time with the square of its length.
        let column = match word.at - word.line_at {
            bytes if bytes > 4096 => bytes + 1,
            _ => self.text[word.line_at..word.at].chars().count() + 1,
        };
        let (line, item) = (word.line as usize, item.to_owned());
        Place { file: file.to_owned(), line, column, item }
    }

    /// Where the file ends.
    pub fn end(&self, file: &Path, item: &str) -> Place {
        Place { file: file.to_owned(), line: self.line as usize, column: 0, item: item.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<(String, u32, usize)> {
        let mut lexer = Lexer::new(text);
        let mut out = Vec::new();
        while let Some(w) = lexer.word() {
            let place = lexer.place(Path::new("f"), w, "");
            out.push((w.text.to_owned(), w.line, place.column));
        }
        out
    }

    #[test]
    fn words_know_their_line_and_column() {
        let got = words("void  plastic é x # rest\r\n\n 5 'two words' \"open\n#c\nend");
        let want = [
            ("void", 1, 1),
            ("plastic", 1, 7),
            ("é", 1, 15),
            ("x", 1, 17),
            ("5", 3, 2),
            ("two words", 3, 4),
            ("\"open", 3, 16),
            ("end", 5, 1),
        ];
        assert_eq!(got, want.map(|(t, l, c)| (t.to_owned(), l, c)));
    }

    #[test]
    fn commands_continue_after_a_backslash() {
        let mut lexer = Lexer::new("!xform -t 1 2 3 \\\n a.rad\nnext");
        assert_eq!(lexer.skip_line(), "!xform -t 1 2 3 \\\n a.rad");
        let word = lexer.word().unwrap();
        assert_eq!((word.text, word.line, word.leads), ("next", 3, true));
    }
}
