//! The numbers of a BSDF file's `ScatteringData`: lists and trees, strictly.

use super::tree::{MOST_LEVELS, Raw};

/// Largest value that a BSDF can have, 1/sr: a mirror over cells of 2^-12 of the square has 5e6.
const MOST_VALUE: f64 = 1e9;

/// Something that isn't as it must be, at a byte of the text.
pub(super) struct Wrong {
    pub byte: usize,
    pub expected: String,
    pub found: String,
}

/// A tree and what was noticed.
pub(super) struct ReadTree {
    pub raw: Raw,
    pub negative: usize,
    pub levels: u32,
}

struct Cursor<'a> {
    text: &'a str,
    at: usize,
    negative: usize,
}

impl<'a> Cursor<'a> {
    fn new(text: &'a str) -> Self {
        Self { text, at: 0, negative: 0 }
    }

    fn blank(&mut self) {
        let rest = &self.text.as_bytes()[self.at..];
        self.at += rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
    }

    /// The next byte that isn't blank.
    fn peek(&mut self) -> Option<u8> {
        self.blank();
        self.text.as_bytes().get(self.at).copied()
    }

    fn wrong(&self, expected: impl Into<String>) -> Wrong {
        let rest = &self.text[self.at.min(self.text.len())..];
        let found: String =
            rest.chars().take_while(|c| !c.is_whitespace() && *c != ',').take(24).collect();
        let found = if found.is_empty() {
            rest.chars().next().map_or("the end".into(), |c| format!("{c:?}"))
        } else {
            format!("`{found}`")
        };
        Wrong { byte: self.at, expected: expected.into(), found }
    }

    /// A number and the one comma that may follow it.
    fn number(&mut self) -> Result<f32, Wrong> {
        self.blank();
        let rest = &self.text.as_bytes()[self.at..];
        let length = rest
            .iter()
            .take_while(|b| !b.is_ascii_whitespace() && !matches!(b, b',' | b'{' | b'}'))
            .count();
        let value = std::str::from_utf8(&rest[..length])
            .ok()
            .and_then(|t| t.parse::<f64>().ok())
            .filter(|v| v.abs() <= MOST_VALUE)
            .ok_or_else(|| self.wrong(format!("a number up to {MOST_VALUE:e} 1/sr")))?;
        self.at += length;
        if self.peek() == Some(b',') {
            self.at += 1;
        }
        if value < 0.0 {
            self.negative += 1;
        }
        Ok(value.max(0.0) as f32)
    }
}

/// Exactly `count` numbers, separated by blanks, tabs, line ends or single commas, and how many of
/// them were negative (and taken as 0).
pub(super) fn list(text: &str, count: usize) -> Result<(Vec<f32>, usize), Wrong> {
    let mut cursor = Cursor::new(text);
    // A number and what separates it have two bytes at least.
    if text.len() / 2 + 1 < count {
        cursor.at = text.len();
        return Err(cursor.wrong(format!("{count} numbers")));
    }
    let mut values = Vec::with_capacity(count);
    while values.len() < count {
        if cursor.peek().is_none() {
            let expected = format!("{count} numbers, of which {} are there", values.len());
            return Err(cursor.wrong(expected));
        }
        values.push(cursor.number()?);
    }
    if cursor.peek().is_some() {
        return Err(cursor.wrong(format!("the end after {count} numbers")));
    }
    Ok((values, cursor.negative))
}

/// A tensor tree: `{` either `2^rank` trees or `2^(rank k)` numbers `}`. In branches the first
/// coordinate is the lowest bit; in lists of numbers it changes slowest.
pub(super) fn tree(text: &str, rank: usize) -> Result<ReadTree, Wrong> {
    let mut cursor = Cursor::new(text);
    let mut out = ReadTree { raw: Raw { rank, ..Raw::default() }, negative: 0, levels: 0 };
    out.raw.root = node(&mut cursor, &mut out.raw, 0, &mut out.levels)?;
    if cursor.peek().is_some() {
        return Err(cursor.wrong("the end of the tree"));
    }
    out.negative = cursor.negative;
    Ok(out)
}

fn node(cursor: &mut Cursor, raw: &mut Raw, level: u32, levels: &mut u32) -> Result<u32, Wrong> {
    const FULL: &str = "fewer nodes";
    if cursor.peek() != Some(b'{') {
        return Err(cursor.wrong("`{`"));
    }
    if level > MOST_LEVELS {
        return Err(cursor.wrong(format!("at most {MOST_LEVELS} levels")));
    }
    cursor.at += 1;
    let rank = raw.rank;
    let done = if cursor.peek() == Some(b'{') {
        let mut children = [0; 16];
        for c in &mut children[..1 << rank] {
            *c = node(cursor, raw, level + 1, levels)?;
            if cursor.peek() == Some(b',') {
                cursor.at += 1;
            }
        }
        raw.branch(&children[..1 << rank]).ok_or_else(|| cursor.wrong(FULL))?
    } else {
        let mut values = Vec::new();
        while cursor.peek().is_some_and(|b| b != b'}') {
            values.push(cursor.number()?);
        }
        let below = (0..=MOST_LEVELS).find(|k| values.len() == 1 << (rank as u32 * k));
        let below = below.filter(|k| level + k <= MOST_LEVELS).ok_or_else(|| {
            cursor.wrong(format!(
                "1, {}, {}, … numbers between braces (here are {}), down to level {MOST_LEVELS}",
                1 << rank,
                1 << (2 * rank),
                values.len()
            ))
        })?;
        *levels = (*levels).max(level + below);
        grid(raw, &values, below, &[0; 4]).ok_or_else(|| cursor.wrong(FULL))?
    };
    if cursor.peek() != Some(b'}') {
        return Err(cursor.wrong("`}`"));
    }
    cursor.at += 1;
    Ok(done)
}

/// A grid of numbers as branches; `corner` in cells of the grid's `2^levels` per edge.
fn grid(raw: &mut Raw, values: &[f32], below: u32, corner: &[usize; 4]) -> Option<u32> {
    let rank = raw.rank;
    let levels = values.len().trailing_zeros() / rank as u32;
    if below == 0 {
        let index = corner[..rank].iter().fold(0, |n, c| (n << levels) + c);
        return raw.leaf(values[index]);
    }
    let mut children = [0; 16];
    for (n, c) in children[..1 << rank].iter_mut().enumerate() {
        let mut at = *corner;
        for (i, x) in at.iter_mut().enumerate() {
            *x += (n >> i & 1) << (below - 1);
        }
        *c = grid(raw, values, below - 1, &at)?;
    }
    raw.branch(&children[..1 << rank])
}
