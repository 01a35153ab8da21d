//! `!xform` and `!cat` lines of Radiance scenes, executed here instead of by a shell.
//!
//! Scenes of offices are mostly arrays of `!xform`; a program that ran a shell on somebody's scene
//! file would execute whatever stands there. So the line is split as a shell would split it,
//! everything that a shell would expand is refused by name, and the options of `xform` (arrays,
//! `-f` files of arguments, pipes into further `xform`s) are followed after Radiance's manual page.

use glam::DVec3;

use super::transform::Transform;
use crate::base::limits;

/// What a `!` line asks for: files, each of them placed so often.
#[derive(Debug, PartialEq)]
pub(super) struct Command {
    pub files: Vec<String>,
    pub copies: Vec<Copy>,
}

/// One run of `xform` over its files.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Copy {
    pub transform: Transform,
    /// `-I`: fronts become backs.
    pub inverts: bool,
    /// `-m`: every surface's modifier.
    pub modifier: Option<String>,
    /// `-n`, and the number in an array.
    pub prefix: Option<String>,
}

impl Copy {
    pub const PLAIN: Self =
        Self { transform: Transform::IDENTITY, inverts: false, modifier: None, prefix: None };

    /// What a copy of a copy is: this one inside `outer`, whose modifier wins.
    pub fn inside(&self, outer: &Self) -> Self {
        let prefix = match (&outer.prefix, &self.prefix) {
            (Some(a), Some(b)) => Some(format!("{a}.{b}")),
            (a, b) => a.clone().or_else(|| b.clone()),
        };
        Self {
            transform: self.transform.then(outer.transform),
            inverts: self.inverts != outer.inverts,
            modifier: outer.modifier.clone().or_else(|| self.modifier.clone()),
            prefix,
        }
    }
}

/// The text of a file that `xform -f` names, or why it can't be read.
pub(super) type Open<'a> = &'a mut dyn FnMut(&str) -> Result<String, String>;

/// Reads a command line (without its `!`): `xform … FILE…` or `cat FILE…`, through further
/// `xform`s where pipes lead to them. No shell is involved: what one would expand is refused.
pub(super) fn parse(line: &str, open: Open<'_>) -> Result<Command, String> {
    let mut stages = split(line)?.into_iter();
    let first = stages.next().unwrap_or_default();
    let name = first.first().map_or("", String::as_str);
    let base = name.rsplit(['/', '\\']).next().unwrap_or(name);
    let mut command = match base {
        "xform" => xform(&first[1..], open)?,
        "cat" => {
            if let Some(option) = first[1..].iter().find(|a| a.starts_with('-')) {
                return Err(format!("cat's option `{option}` isn't known here"));
            }
            Command { files: first[1..].to_vec(), copies: vec![Copy::PLAIN] }
        }
        _ => {
            return Err(format!(
                "`{name}` isn't run: only `xform` and `cat` are known here; put what it writes into a file (`{} > part.rad`) and include that with `!xform part.rad`",
                line.split('|').next().unwrap_or_default().trim()
            ));
        }
    };
    if command.files.is_empty() {
        return Err(format!("{base} names no file to read"));
    }
    for stage in stages {
        let name = stage.first().map_or("", String::as_str);
        if name.rsplit('/').next() != Some("xform") {
            return Err(format!("`{name}` isn't run: only `xform` may follow a pipe"));
        }
        let next = xform(&stage[1..], open)?;
        if let Some(file) = next.files.first() {
            return Err(format!("xform after a pipe reads what comes through it, not `{file}`"));
        }
        bounded(command.copies.len() as u64 * next.copies.len() as u64)?;
        let inner = std::mem::take(&mut command.copies);
        command.copies =
            next.copies.iter().flat_map(|o| inner.iter().map(|i| i.inside(o))).collect();
    }
    Ok(command)
}

fn bounded(copies: u64) -> Result<(), String> {
    if copies > limits::MAX_XFORM_COPIES {
        return Err(format!(
            "{copies} copies; an array may make {} at most: leave out what lies beyond the reach of the light",
            limits::MAX_XFORM_COPIES
        ));
    }
    Ok(())
}

/// Words by pipe stage, as a shell would see them.
fn split(line: &str) -> Result<Vec<Vec<String>>, String> {
    let mut stages = vec![Vec::new()];
    let mut word: Option<String> = None;
    let mut chars = line.chars().peekable();
    let end = |word: &mut Option<String>, stages: &mut Vec<Vec<String>>| {
        if let (Some(word), Some(stage)) = (word.take(), stages.last_mut()) {
            stage.push(word);
        }
    };
    while let Some(c) = chars.next() {
        match c {
            '\'' | '"' => {
                let word = word.get_or_insert_default();
                loop {
                    match chars.next() {
                        None => return Err(format!("a quote {c} is never closed")),
                        Some(q) if q == c => break,
                        Some('$' | '`') if c == '"' => {
                            return Err("`$` and backquotes need a shell, which isn't run".into());
                        }
                        Some(q) => word.push(q),
                    }
                }
            }
            '\\' => match chars.next() {
                // A continued line.
                None | Some('\n') => {}
                Some('\r') => {
                    chars.next_if_eq(&'\n');
                }
                Some(escaped) => word.get_or_insert_default().push(escaped),
            },
            '|' => {
                end(&mut word, &mut stages);
                stages.push(Vec::new());
            }
            ';' | '&' | '<' | '>' | '$' | '`' | '*' | '?' | '(' | ')' => {
                return Err(format!("`{c}` needs a shell, which isn't run"));
            }
            '#' if word.is_none() => break,
            c if c.is_whitespace() => end(&mut word, &mut stages),
            c => word.get_or_insert_default().push(c),
        }
    }
    end(&mut word, &mut stages);
    Ok(stages)
}

fn xform(arguments: &[String], open: Open<'_>) -> Result<Command, String> {
    // The number of copies is known before any is made.
    let mut copies = 1_u64;
    for pair in arguments.windows(2).filter(|pair| pair[0] == "-a") {
        let count = count(&pair[1]).filter(|&n| n > 0);
        let count = count
            .ok_or_else(|| format!("expected a number of copies after -a, found `{}`", pair[1]))?;
        copies = copies.saturating_mul(count);
    }
    bounded(copies)?;
    let mut command = Command { files: Vec::new(), copies: Vec::new() };
    arrays(arguments, 0, open, &mut command)?;
    Ok(command)
}

/// xform.c's doarray() and doargf(): an array is so many runs with `-a N` replaced by `-i 0`,
/// `-i 1`, …; a file of arguments is a run for each of its lines, which stands for `-f FILE`.
fn arrays(
    arguments: &[String],
    depth: usize,
    open: Open<'_>,
    out: &mut Command,
) -> Result<(), String> {
    let at = |option: &str| arguments.iter().position(|a| a == option);
    // As xform does: files first, whatever their place.
    let Some(at) = at("-f").or_else(|| at("-a")) else {
        return single(arguments, out);
    };
    if depth > limits::MAX_NESTING {
        return Err(format!(
            "more than {} arrays and files of arguments in each other; does one name itself?",
            limits::MAX_NESTING
        ));
    }
    let next = arguments.get(at + 1);
    if arguments[at] == "-f" {
        let text = open(next.ok_or("expected a file of arguments after -f")?)?;
        let lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
        for (i, line) in lines.enumerate() {
            let words = split(line)?.into_iter().next().unwrap_or_default();
            let mut run = arguments.to_vec();
            run.splice(at..at + 2, words);
            number(&mut run, i as u64, 'i');
            arrays(&run, depth + 1, open, out)?;
        }
        return Ok(());
    }
    let n = next.and_then(|n| count(n)).ok_or("expected a number of copies after -a")?;
    bounded(n)?;
    for i in 0..n {
        let mut run = arguments.to_vec();
        run[at] = "-i".to_owned();
        run[at + 1] = i.to_string();
        number(&mut run, i, 'a');
        arrays(&run, depth + 1, open, out)?;
    }
    Ok(())
}

/// Names the copy of an array: `-n NAME` becomes `NAME.I`; without a name it is `aI` or `iI`.
fn number(run: &mut Vec<String>, i: u64, letter: char) {
    let mut named = false;
    for k in 1..run.len() {
        if run[k - 1] == "-n" {
            run[k] = format!("{}.{i}", run[k]);
            named = true;
        }
    }
    if !named {
        run.splice(0..0, ["-n".to_owned(), format!("{letter}{i}")]);
    }
}

fn single(arguments: &[String], out: &mut Command) -> Result<(), String> {
    let mut copy = Copy::PLAIN;
    let mut at = 0;
    while let Some(option) = arguments.get(at) {
        match (option.as_str(), arguments.get(at + 1)) {
            ("-m", Some(name)) => {
                copy.modifier.get_or_insert_with(|| name.clone());
                at += 2;
            }
            ("-n", Some(name)) => {
                copy.prefix = Some(match &copy.prefix {
                    Some(before) => format!("{before}.{name}"),
                    None => name.clone(),
                });
                at += 2;
            }
            ("-c" | "-e" | "-l", _) => at += 1,
            ("-I", _) => {
                copy.inverts = !copy.inverts;
                at += 1;
            }
            _ => break,
        }
    }
    let (transform, used) = transform(&arguments[at..])?;
    copy.transform = transform;
    let files = &arguments[at + used..];
    if let Some(option) = files.iter().find(|f| f.starts_with('-')) {
        return Err(format!("xform doesn't know `{option}` here"));
    }
    if out.copies.is_empty() {
        out.files = files.to_vec();
    }
    out.copies.push(copy);
    bounded(out.copies.len() as u64)?;
    Ok(())
}

fn count(text: &str) -> Option<u64> {
    text.parse::<i64>().ok().map(|n| n.max(0) as u64)
}

/// xf.c's xf(): transforms in order; `-i N` ends the group before it and repeats the one after it.
/// Returns how many arguments were read.
pub(super) fn transform(arguments: &[String]) -> Result<(Transform, usize), String> {
    let mut total = Transform::IDENTITY;
    let (mut group, mut times) = (Transform::IDENTITY, 1);
    let mut at = 0;
    while let Some(option) = arguments.get(at).filter(|a| a.starts_with('-')) {
        let real = |i: usize| -> Result<f64, String> {
            let text = arguments.get(at + i);
            let value = text.and_then(|t| t.parse::<f64>().ok());
            value.filter(|v| v.abs() < 1e9).ok_or_else(|| {
                let found = text.map_or("nothing", String::as_str);
                format!("xform: expected a number after {option}, found `{found}`")
            })
        };
        let (step, used) = match option.as_str() {
            "-t" => (Transform::translation(DVec3::new(real(1)?, real(2)?, real(3)?)), 4),
            "-rx" => (Transform::rotation(0, real(1)?), 2),
            "-ry" => (Transform::rotation(1, real(1)?), 2),
            "-rz" => (Transform::rotation(2, real(1)?), 2),
            "-s" => {
                let scale = real(1)?;
                if scale.abs() < 1e-9 {
                    return Err(format!("xform: a scale of {scale} leaves nothing"));
                }
                (Transform::scaling(scale), 2)
            }
            "-mx" => (Transform::mirror(0), 1),
            "-my" => (Transform::mirror(1), 1),
            "-mz" => (Transform::mirror(2), 1),
            "-i" => {
                let n = arguments.get(at + 1).and_then(|n| count(n));
                let n = n.ok_or("xform: expected a whole number after -i")?;
                bounded(n)?;
                total = total.then(group.repeated(times));
                (group, times) = (Transform::IDENTITY, n);
                at += 2;
                continue;
            }
            other => return Err(format!("xform doesn't know `{other}`")),
        };
        group = group.then(step);
        at += used;
    }
    Ok((total.then(group.repeated(times)), at))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(line: &str) -> Result<Command, String> {
        parse(line, &mut |name| match name {
            "list" => Ok("-t 1 0 0\n# no\n\n -n k -t 2 0 0 -a 2 -rz 90\n".into()),
            "self" => Ok("-f self\n".into()),
            _ => Err(format!("can't read `{name}`")),
        })
    }

    #[test]
    fn arguments_from_a_file_are_an_array() {
        // As xform of Radiance names them.
        let c = parsed("xform -f list -i 1 -t 0 7 0 a.rad").unwrap();
        let names: Vec<_> = c.copies.iter().map(|c| c.prefix.as_deref().unwrap()).collect();
        assert_eq!(names, ["i0", "k.1.0", "k.1.1"]);
        let p = c.copies[2].transform.point(DVec3::ZERO);
        assert!((p - DVec3::new(0.0, 9.0, 0.0)).length() < 1e-12, "{p}");
        assert!(parsed("xform -f self a.rad").unwrap_err().contains("name itself"));
    }

    #[test]
    fn arrays_nest_and_repeat() {
        let c = parsed("xform -n b -a 3 -t 1 0 0 -a 2 -t 0 5 0 -i 1 -rz 90 part.rad").unwrap();
        assert_eq!((c.files.len(), c.copies.len()), (1, 6));
        assert_eq!(c.copies[5].prefix.as_deref(), Some("b.2.1"));
        let p = c.copies[5].transform.point(DVec3::ZERO);
        assert!((p - DVec3::new(-5.0, 2.0, 0.0)).length() < 1e-12, "{p}");
        let plain = parsed("xform -a 2 -a 2 -t 1 0 0 'a b.rad'").unwrap();
        assert_eq!(plain.copies[3].prefix.as_deref(), Some("a1.1"));
        assert_eq!(plain.files, ["a b.rad"]);
    }

    #[test]
    fn pipes_apply_one_after_another() {
        let c = parsed("cat a.rad b.rad | xform -m red -t 1 0 0 | xform -n x -mx").unwrap();
        assert_eq!(c.files, ["a.rad", "b.rad"]);
        assert_eq!(c.copies[0].transform.point(DVec3::ZERO), DVec3::NEG_X);
        assert!(c.copies[0].transform.mirrors());
        assert_eq!(c.copies[0].modifier.as_deref(), Some("red"));
    }

    #[test]
    fn what_is_refused_says_why() {
        for (line, word) in [
            ("xform -a 1000 -a 1000 -t 1 0 0 a.rad", "1000000 copies"),
            ("genbox wall house 1 2 3", "`genbox` isn't run"),
            ("xform -t 1 0 a.rad", "expected a number after -t"),
            ("xform -t 1 0 0", "names no file"),
            ("xform -f nothing a.rad", "`nothing`"),
            ("xform -a 1000 -f list -a 1000 a.rad", "1000000 copies"),
            ("cat a.rad; rm b", "`;`"),
            ("cat $HOME/a.rad", "`$`"),
            ("cat a.rad | grep x", "`grep`"),
            ("xform -i 99999999999 -t 1 0 0 a.rad", "copies"),
            ("", "isn't run"),
        ] {
            let message = parsed(line).unwrap_err();
            assert!(message.contains(word), "{line}: {message}");
        }
    }
}
