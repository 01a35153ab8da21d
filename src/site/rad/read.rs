//! Reads Radiance scenes: primitives one after the other, includes in their place.

use std::path::Path;

use super::command::{self, Command, Copy};
use super::files::Included;
use super::lexer::{Lexer, Word};
use super::materials::{self, Class};
use super::names::Names;
use crate::base::{Place, limits};
use crate::site::Files;
use crate::site::draft::{Draft, Full, SourceFile};
use crate::site::log::Log;

/// Reads a scene file, and what it includes, into the draft. Faults go to the log; reading goes on
/// with the next primitive until the log is full.
pub(in crate::site) fn read(
    file: SourceFile<'_>,
    text: &str,
    files: &Files,
    names: &mut Names,
    draft: &mut Draft,
    log: &mut Log,
) -> Result<(), Full> {
    let SourceFile { number: source, path: file } = file;
    let mut included = Included::new(files, file);
    let mut reader = Reader {
        lexer: Lexer::new(text),
        file,
        source,
        copy: &Copy::PLAIN,
        depth: 0,
        line: None,
        included: &mut included,
        names,
        draft,
        log,
    };
    reader.all()
}

pub(super) enum Stop {
    /// A fault was logged; go on at the next primitive.
    Resync,
    /// The scene is too large.
    Full,
}

impl From<Full> for Stop {
    fn from(_: Full) -> Self {
        Self::Full
    }
}

pub(super) struct Reader<'a, 'b, 'c> {
    lexer: Lexer<'a>,
    pub file: &'b Path,
    pub source: u32,
    /// How what stands here is placed.
    pub copy: &'b Copy,
    /// How many files include this one.
    depth: usize,
    /// In an included file: the line of the outermost file that includes it.
    pub line: Option<u32>,
    pub included: &'b mut Included<'c>,
    pub names: &'b mut Names,
    pub draft: &'b mut Draft,
    pub log: &'b mut Log,
}

/// A primitive's head and arguments.
pub(super) struct Primitive<'a> {
    pub modifier: &'a str,
    pub kind: &'a str,
    pub name: &'a str,
    pub head: Word<'a>,
    pub strings: Vec<&'a str>,
    pub reals: Vec<f64>,
}

impl<'a> Reader<'a, '_, '_> {
    fn all(&mut self) -> Result<(), Full> {
        while !self.log.full() {
            match self.statement() {
                Ok(true) => {}
                Ok(false) => break,
                Err(Stop::Resync) => self.resync(),
                Err(Stop::Full) => return Err(Full),
            }
        }
        Ok(())
    }

    /// Reads what a command would write.
    fn command(&mut self, line: &str, number: u32, place: Place) -> Result<(), Stop> {
        let (included, file) = (&mut *self.included, self.file);
        let mut open = |name: &str| {
            let (_, bytes) = included.open(file, name)?;
            Ok(String::from_utf8_lossy(&bytes).into_owned())
        };
        match command::parse(line, &mut open) {
            Ok(command) => self.include(&command, number, place),
            Err(why) => {
                let spelt = line.split_whitespace().collect::<Vec<_>>().join(" ");
                self.log.fault(place, format!("command `!{spelt}`: {why}"));
                Ok(())
            }
        }
    }

    /// Reads the files of a command, each copy of them in turn.
    pub fn include(&mut self, command: &Command, number: u32, place: Place) -> Result<(), Stop> {
        if self.depth >= limits::MAX_NESTING {
            self.log.fault(
                place,
                format!(
                    "files include each other more than {} deep; does `{}` include itself?",
                    limits::MAX_NESTING,
                    self.file.display()
                ),
            );
            return Ok(());
        }
        for copy in &command.copies {
            for name in &command.files {
                let (path, bytes) = match self.included.open(self.file, name) {
                    Ok(opened) => opened,
                    Err(why) => {
                        self.log.fault(place, why);
                        return Ok(());
                    }
                };
                let faults = self.log.faults.len();
                let copy = copy.inside(self.copy);
                let text = String::from_utf8_lossy(&bytes);
                Reader {
                    lexer: Lexer::new(&text),
                    file: &path,
                    source: self.source,
                    copy: &copy,
                    depth: self.depth + 1,
                    line: Some(self.line.unwrap_or(number)),
                    included: self.included,
                    names: self.names,
                    draft: self.draft,
                    log: self.log,
                }
                .all()?;
                // The next copy has the same faults.
                if self.log.faults.len() > faults {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Reads one primitive; false at the end of the file.
    fn statement(&mut self) -> Result<bool, Stop> {
        let Some(modifier) = self.lexer.word() else { return Ok(false) };
        if modifier.text.starts_with('!') {
            let place = self.lexer.place(self.file, modifier, "");
            let rest = self.lexer.skip_line();
            let line = format!("{}{rest}", &modifier.text[1..]);
            self.command(&line, modifier.line, place)?;
            return Ok(true);
        }
        let kind = self.expect("a primitive's type", modifier)?;
        let known = kind.text == "alias" || materials::classify(kind.text) != Class::Unknown;
        if !known && modifier.text.parse::<f64>().is_ok() {
            let place = self.lexer.place(self.file, modifier, "");
            return Err(self.fault(place, format!(
                "expected a modifier's name, found the number `{}`: the primitive before it has more arguments than it says",
                modifier.text
            )));
        }
        let name = self.expect("the primitive's name", kind)?;
        if kind.text == "alias" {
            let target = self.expect("the alias's target", name)?;
            let place = self.lexer.place(self.file, modifier, name.text);
            self.alias(modifier.text, name.text, target.text, place);
            return Ok(true);
        }
        if !known && let Some(near) = materials::nearest_surface(kind.text) {
            let place = self.lexer.place(self.file, kind, name.text);
            return Err(
                self.fault(place, format!("unknown type `{}`; did you mean `{near}`?", kind.text))
            );
        }
        let primitive = self.arguments(modifier, kind, name)?;
        self.take(&primitive)?;
        Ok(true)
    }

    fn expect(&mut self, what: &str, after: Word<'a>) -> Result<Word<'a>, Stop> {
        if let Some(word) = self.lexer.word() {
            return Ok(word);
        }
        let place = self.lexer.end(self.file, "");
        let message = format!("the file ends after `{}`; expected {what}", after.text);
        Err(self.fault(place, message))
    }

    pub fn place(&self, p: &Primitive<'_>) -> Place {
        self.lexer.place(self.file, p.head, p.name)
    }

    pub fn fault(&mut self, place: Place, message: impl Into<String>) -> Stop {
        self.log.fault(place, message);
        Stop::Resync
    }

    /// Goes on at the next line that begins like a primitive.
    fn resync(&mut self) {
        loop {
            let here = self.lexer.clone();
            let Some(word) = self.lexer.word() else { return };
            if !word.leads {
                continue;
            }
            let begins = word.text.starts_with('!')
                || self.lexer.peek().is_some_and(|kind| {
                    kind.text == "alias"
                        || materials::classify(kind.text) != Class::Unknown
                        || materials::nearest_surface(kind.text).is_some()
                });
            if begins {
                self.lexer = here;
                return;
            }
        }
    }

    /// The three counted lists: strings, integers, reals.
    fn arguments(
        &mut self,
        modifier: Word<'a>,
        kind: Word<'a>,
        name: Word<'a>,
    ) -> Result<Primitive<'a>, Stop> {
        let mut primitive = Primitive {
            modifier: modifier.text,
            kind: kind.text,
            name: name.text,
            head: modifier,
            strings: Vec::new(),
            reals: Vec::new(),
        };
        for what in ["string arguments", "integer arguments", "numbers"] {
            let count = self.count(what, name)?;
            // The count is a claim: words are taken one by one until the file ends.
            for i in 0..count {
                let before = self.lexer.clone();
                let Some(word) = self.lexer.word() else {
                    let place = self.lexer.end(self.file, name.text);
                    let message = format!(
                        "{} says it has {count} {what}, the file ends after {i}",
                        kind.text
                    );
                    return Err(self.fault(place, message));
                };
                if what == "string arguments" {
                    primitive.strings.push(word.text);
                    continue;
                }
                let value = word.text.parse::<f64>().ok().filter(|v| v.is_finite());
                let Some(value) = value else {
                    self.lexer = before;
                    let place = self.lexer.place(self.file, word, name.text);
                    let message = format!(
                        "{} says it has {count} {what}; expected the {} of them, found `{}`",
                        kind.text,
                        ordinal(i + 1),
                        word.text
                    );
                    return Err(self.fault(place, message));
                };
                if what == "numbers" {
                    primitive.reals.push(value);
                }
            }
        }
        Ok(primitive)
    }

    fn count(&mut self, what: &str, name: Word<'a>) -> Result<u64, Stop> {
        let before = self.lexer.clone();
        let word = self.expect(&format!("how many {what} there are"), name)?;
        word.text.parse::<u64>().map_err(|_| {
            self.lexer = before;
            let place = self.lexer.place(self.file, word, name.text);
            let message = format!("expected how many {what} there are, found `{}`", word.text);
            self.fault(place, message)
        })
    }
}

fn ordinal(i: u64) -> String {
    let suffix = match (i % 10, i % 100) {
        (_, 11..=13) => "th",
        (1, _) => "st",
        (2, _) => "nd",
        (3, _) => "rd",
        _ => "th",
    };
    format!("{i}{suffix}")
}
