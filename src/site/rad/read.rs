use std::path::Path;

use glam::DVec3;

use super::command::{self, Copy};
use super::files::Included;
use super::lexer::{Lexer, Word};
use super::materials::{self, Class};
use super::names::{Names, Target};
use super::shapes;
use crate::base::{Place, limits};
use crate::site::draft::{Draft, Full, Shape, Surface, in_reach};
use crate::site::log::Log;
use crate::site::mesh::{self, Owner};
use crate::site::{Material, Object};

/// Reads a scene file, and what it includes, into the draft. Faults go to the log; reading goes on
/// with the next primitive until the log is full.
pub(in crate::site) fn read(
    (source, file): (u32, &Path),
    text: &str,
    names: &mut Names,
    draft: &mut Draft,
    log: &mut Log,
) -> Result<(), Full> {
    let mut included = Included::default();
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

enum Stop {
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

struct Reader<'a, 'b> {
    lexer: Lexer<'a>,
    file: &'b Path,
    source: u32,
    /// How what stands here is placed.
    copy: &'b Copy,
    /// How many files include this one.
    depth: usize,
    /// In an included file: the line of the outermost file that includes it.
    line: Option<u32>,
    included: &'b mut Included,
    names: &'b mut Names,
    draft: &'b mut Draft,
    log: &'b mut Log,
}

/// A primitive's head and arguments.
struct Primitive<'a> {
    modifier: &'a str,
    kind: &'a str,
    name: &'a str,
    head: Word<'a>,
    strings: Vec<&'a str>,
    reals: Vec<f64>,
}

impl<'a> Reader<'a, '_> {
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
        let command = match command::parse(line) {
            Ok(command) => command,
            Err(why) => {
                let spelt = line.split_whitespace().collect::<Vec<_>>().join(" ");
                self.log.fault(place, format!("command `!{spelt}`: {why}"));
                return Ok(());
            }
        };
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

    fn place(&self, p: &Primitive<'_>) -> Place {
        self.lexer.place(self.file, p.head, p.name)
    }

    fn fault(&mut self, place: Place, message: impl Into<String>) -> Stop {
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

    fn alias(&mut self, modifier: &str, name: &str, target: &str, place: Place) {
        match self.names.find(target) {
            Some(found) => {
                let unfollowed = modifier != "void" && modifier != "inherit";
                let caveat = unfollowed.then(|| {
                    format!("alias `{name}`: what `{modifier}` does to `{target}` isn't followed")
                });
                self.names.define(name, found, place, caveat);
            }
            None => {
                let caveat = format!(
                    "alias `{name}`: `{target}` isn't defined before it; taken as diffuse with the default reflectance"
                );
                let plain = self.names.plain(name);
                self.names.define_material(self.draft, plain, place, Some(caveat));
            }
        }
    }

    fn take(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        match materials::classify(p.kind) {
            Class::Surface => self.surface(p),
            Class::Nested => self.nested(p),
            Class::Material | Class::Unknown => self.material(p),
            Class::Pattern => {
                self.pattern(p);
                Ok(())
            }
            Class::Mixture => {
                let caveat = format!(
                    "{} `{}` isn't followed; taken as diffuse with the default reflectance",
                    p.kind, p.name
                );
                let plain = self.names.plain(p.name);
                self.names.define_material(self.draft, plain, self.place(p), Some(caveat));
                Ok(())
            }
            Class::Invisible => {
                self.names.define(p.name, Target::Nothing, self.place(p), None);
                Ok(())
            }
        }
    }

    fn material(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        let default = self.names.default_reflectance();
        let made = materials::material(p.kind, p.name, &p.reals, default);
        let made = made.map_err(|message| self.fault(self.place(p), message))?;
        let mut caveat = made.caveat;
        if p.modifier != "void" && caveat.is_none() {
            caveat = Some(format!(
                "what `{}` does to the material `{}` isn't followed",
                p.modifier, p.name
            ));
        }
        self.names.define_material(self.draft, made.material, self.place(p), caveat);
        Ok(())
    }

    /// A pattern or texture: surfaces that it modifies are of the material before it.
    fn pattern(&mut self, p: &Primitive<'_>) {
        let caveat = format!("what {} `{}` does to its material isn't followed", p.kind, p.name);
        match self.names.find(p.modifier) {
            Some(target @ Target::Material(_)) => {
                self.names.define(p.name, target, self.place(p), Some(caveat));
            }
            _ => {
                let plain = self.names.plain(p.name);
                self.names.define_material(self.draft, plain, self.place(p), Some(caveat));
            }
        }
    }

    /// `mesh`: its triangles, where the file is one that holds them as text.
    fn nested(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        let file = p.strings.first().copied().unwrap_or_default();
        let lower = file.to_ascii_lowercase();
        if p.kind != "mesh" || !lower.ends_with(".obj") {
            let how = match p.kind {
                "mesh" => "Radiance's binary meshes aren't read: name the .obj that it was made of",
                _ => "octrees aren't read: include the scene that it was made of with `!xform`",
            };
            let message = format!("{} `{}` refers to `{file}`; {how}", p.kind, p.name);
            return Err(self.fault(self.place(p), message));
        }
        let words: Vec<String> = p.strings[1..].iter().map(|&w| w.to_owned()).collect();
        let own = match command::transform(&words) {
            Ok((transform, used)) if used == words.len() => transform,
            Ok((_, used)) => {
                let message = format!("xform doesn't know `{}` here", words[used]);
                return Err(self.fault(self.place(p), message));
            }
            Err(why) => return Err(self.fault(self.place(p), why)),
        };
        let (path, bytes) =
            self.included.open(self.file, file).map_err(|why| self.fault(self.place(p), why))?;
        let Some(mesh) = mesh::obj(&path, &bytes, self.log) else { return Err(Stop::Resync) };
        let transform = own.then(self.copy.transform);
        let modifier = self.copy.modifier.as_deref().unwrap_or(p.modifier);
        let object = self.object(p.name, p.kind);
        let materials = self.mesh_materials(&mesh, modifier, &self.place(p));
        let owner = Owner {
            source: self.source,
            line: self.line.unwrap_or(p.head.line),
            object: Some(object),
            materials: &materials,
            mirrored: transform.mirrors() != self.copy.inverts,
        };
        Ok(mesh.add(|q| transform.point(q), &owner, self.draft, self.log, &path)?)
    }

    /// The material of each of a mesh's: the primitive's, or by name where it says `void`.
    fn mesh_materials(
        &mut self,
        mesh: &mesh::Mesh,
        modifier: &str,
        place: &Place,
    ) -> Vec<(u32, Option<u32>)> {
        let mut out = Vec::new();
        for own in &mesh.materials {
            let name = if modifier == "void" { own.name.as_str() } else { modifier };
            let number = self.names.number(self.draft, name);
            let material = match self.names.find(name) {
                Some(Target::Material(material)) => {
                    self.names.warn_once(name, self.log);
                    material
                }
                _ => {
                    let plain = self.names.plain(name);
                    let reflectance = own.reflectance.unwrap_or(plain.reflectance);
                    let made = Material { reflectance, ..plain };
                    self.names.define_material(self.draft, made, place.clone(), None);
                    self.draft.materials.len() as u32 - 1
                }
            };
            out.push((material, Some(number)));
        }
        out
    }

    /// A new object under the name that `-n` makes of one.
    fn object(&mut self, name: &str, kind: &str) -> u32 {
        let id = match &self.copy.prefix {
            Some(prefix) => format!("{prefix}.{name}"),
            None => name.to_owned(),
        };
        self.draft.objects.push(Object { id, kind: kind.to_owned() });
        self.draft.objects.len() as u32 - 1
    }

    fn surface(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        if p.kind == "source" {
            let message = "source is ignored: suns and sky come from the project's [time]";
            self.log.warn("sources that are ignored", self.place(p), message);
            return Ok(());
        }
        let modifier = self.copy.modifier.as_deref().unwrap_or(p.modifier);
        let target = self.names.find(modifier);
        if target == Some(Target::Nothing) {
            let message = format!("{} of `{modifier}` is left out: rays pass it", p.kind);
            self.log.warn("surfaces that rays pass", self.place(p), message);
            return Ok(());
        }
        let shape = self.shape(p)?;
        let number = self.names.number(self.draft, modifier);
        let kind = if self.copy.inverts { inside_out(p.kind) } else { p.kind };
        let object = self.object(p.name, kind);
        let material = match target {
            Some(Target::Material(material)) => {
                self.names.warn_once(modifier, self.log);
                material
            }
            _ => {
                self.names.wait(modifier, self.place(p), self.draft.surfaces.len());
                0
            }
        };
        Ok(self.draft.add_surface(Surface {
            shape,
            object,
            material,
            modifier: Some(number),
            source: self.source,
            line: self.line.unwrap_or(p.head.line),
        })?)
    }

    fn shape(&mut self, p: &Primitive<'_>) -> Result<Shape, Stop> {
        let r = &p.reals;
        let wrong = match p.kind {
            "polygon" => polygon_fault(r.len()),
            "sphere" | "bubble" => expects(p, 4, "x y z radius"),
            "cylinder" | "tube" => expects(p, 7, "two ends and a radius"),
            "cone" | "cup" => expects(p, 8, "two ends and two radii"),
            _ => expects(p, 8, "centre, direction and two radii"),
        };
        let far = || r.iter().find(|v| !in_reach(DVec3::splat(**v)));
        let wrong = wrong.or_else(|| far().map(|v| format!("{v} is no coordinate in metres")));
        if let Some(message) = wrong {
            return Err(self.fault(self.place(p), message));
        }
        let placed = &self.copy.transform;
        let inverts = self.copy.inverts;
        let at = |i: usize| placed.point(DVec3::new(r[i], r[i + 1], r[i + 2]));
        let first = self.draft.rings.len();
        let grown = |(radii, negative): ([f64; 2], bool)| {
            (radii.map(|radius| placed.length(radius)), negative != inverts)
        };
        let made = match p.kind {
            "polygon" => {
                let n = r.len() / 3;
                let backward = placed.mirrors() != inverts;
                let order = |i: usize| if backward { n - 1 - i } else { i };
                if let Some(far) = (0..n).map(|i| at(3 * i)).find(|&q| !in_reach(q)) {
                    return Err(self.fault(self.place(p), moved_off(far)));
                }
                self.draft.add_ring((0..n).map(|i| at(3 * order(i))))?;
                return Ok(self.draft.planar_since(first));
            }
            "ring" => {
                let normal = placed.vector(DVec3::new(r[3], r[4], r[5]));
                let normal = if inverts { -normal } else { normal };
                radii(&r[6..8])
                    .map(grown)
                    .and_then(|(radii, _)| shapes::ring(at(0), normal, radii))
                    .map(Ok)
            }
            "sphere" | "bubble" => radii(&[r[3], r[3]])
                .map(grown)
                .map(|(radii, negative)| {
                    shapes::sphere(at(0), radii[0], negative != (p.kind == "bubble"))
                })
                .map(Err),
            "cylinder" | "tube" => radii(&[r[6], r[6]])
                .map(grown)
                .and_then(|(radii, negative)| {
                    shapes::cone([at(0), at(3)], radii, negative != (p.kind == "tube"))
                })
                .map(Err),
            _ => radii(&r[6..8])
                .map(grown)
                .and_then(|(radii, negative)| {
                    shapes::cone([at(0), at(3)], radii, negative != (p.kind == "cup"))
                })
                .map(Err),
        };
        let points = match &made {
            Ok(Ok(rings)) => rings.first().and_then(|ring| ring.first()),
            Ok(Err(corners)) => corners.first(),
            Err(_) => None,
        };
        let reach = points.is_none_or(|&q| in_reach(q)) && placed.length(1.0) < 1e9;
        if !reach {
            return Err(self.fault(self.place(p), moved_off(points.copied().unwrap_or_default())));
        }
        match made {
            Ok(Ok(rings)) => {
                for ring in rings {
                    self.draft.add_ring(ring.into_iter())?;
                }
                Ok(self.draft.planar_since(first))
            }
            Ok(Err(corners)) => Ok(self.draft.add_curved(&corners)?),
            Err(why) => Err(self.fault(self.place(p), format!("{} `{}`: {why}", p.kind, p.name))),
        }
    }
}

fn moved_off(point: DVec3) -> String {
    format!("its transform moves it to {point}, which is no place in metres")
}

/// The type of a surface whose front became its back.
fn inside_out(kind: &str) -> &str {
    let pairs = [("sphere", "bubble"), ("cylinder", "tube"), ("cone", "cup")];
    let other = pairs.iter().find_map(|&(a, b)| {
        if kind == a {
            Some(b)
        } else if kind == b {
            Some(a)
        } else {
            None
        }
    });
    other.unwrap_or(kind)
}

/// What is wrong with a polygon of so many numbers.
fn polygon_fault(numbers: usize) -> Option<String> {
    if numbers < 9 {
        return Some(format!(
            "polygon needs at least 3 vertices (9 numbers), found {numbers}{}",
            if numbers.is_multiple_of(3) {
                format!(" ({} vertices)", numbers / 3)
            } else {
                String::new()
            }
        ));
    }
    if !numbers.is_multiple_of(3) {
        return Some(format!("a polygon's numbers come in threes (x y z), found {numbers}"));
    }
    let vertices = numbers / 3;
    (vertices > limits::MAX_POLYGON_VERTICES).then(|| {
        format!(
            "polygon of {vertices} vertices; {} at most: divide it",
            limits::MAX_POLYGON_VERTICES
        )
    })
}

fn expects(p: &Primitive<'_>, count: usize, what: &str) -> Option<String> {
    (p.reals.len() != count)
        .then(|| format!("{} needs {count} numbers ({what}), found {}", p.kind, p.reals.len()))
}

/// Radii without their sign, and whether they were negative: Radiance then turns the surface
/// inside out.
fn radii(r: &[f64]) -> Result<([f64; 2], bool), &'static str> {
    let (low, high) = (r[0].min(r[1]), r[0].max(r[1]));
    match () {
        () if low == 0.0 && high == 0.0 => Err("radius is 0"),
        () if low < 0.0 && high > 0.0 => Err("one radius is negative, the other isn't"),
        () => Ok(([r[0].abs(), r[1].abs()], low < 0.0)),
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
