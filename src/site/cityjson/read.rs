//! Reads CityJSON and CityJSONSeq: objects, levels of detail, parts, templates.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use glam::DVec3;

use super::geometry::{Builder, Shell, depth_of, template_matrix};
use super::model::{CityObject, Document, Geometry, Templates, Transform};
use crate::base::Place;
use crate::site::draft::{Draft, Full, SourceFile, in_reach};
use crate::site::log::Log;

/// What a file said about itself.
#[derive(Debug, Default)]
pub(in crate::site) struct Read {
    /// `CityJSON 2.0`.
    pub format: String,
    /// Its coordinate reference system.
    pub crs: Option<String>,
    /// How many objects have geometry in each level of detail.
    pub lods: BTreeMap<String, usize>,
    /// City objects in it.
    pub objects: usize,
    /// Geometries without surfaces (points, lines), which aren't read.
    pub unread: usize,
    /// Objects that lack the level of detail that was asked for.
    pub other_lod: usize,
    ids: HashSet<String>,
}

/// How city models are read.
#[derive(Clone, Copy, Debug)]
pub(in crate::site) struct How<'a> {
    /// The level of detail; of each object its highest where none is asked for.
    pub wanted: Option<&'a str>,
    /// Index of the draft's material of what nothing is said about.
    pub material: u32,
}

/// What the readers of one file share.
struct Context<'a> {
    source: u32,
    file: &'a Path,
    wanted: Option<&'a str>,
    material: u32,
    materials: HashMap<String, u32>,
    read: Read,
    draft: &'a mut Draft,
    log: &'a mut Log,
}

impl<'a> Context<'a> {
    fn of(file: SourceFile<'a>, how: How<'a>, draft: &'a mut Draft, log: &'a mut Log) -> Self {
        let SourceFile { number: source, path: file } = file;
        let How { wanted, material } = how;
        let (materials, read) = (named(draft), Read::default());
        Self { source, file, wanted, material, materials, read, draft, log }
    }
}

/// Reads a CityJSON file into the draft: of each object the level of detail `wanted`, or its
/// highest.
pub(in crate::site) fn read(
    file: SourceFile<'_>,
    bytes: &[u8],
    how: How<'_>,
    draft: &mut Draft,
    log: &mut Log,
) -> Result<Read, Full> {
    let mut context = Context::of(file, how, draft, log);
    if let Some(document) = context.parse(bytes, 0)
        && let Some(transform) = context.head(&document, 0)
    {
        let templates = document.templates.as_ref();
        context.objects(&document, transform, templates, 0)?;
    }
    Ok(context.read)
}

/// Reads a CityJSONSeq file: a CityJSON document on the first line, a feature on each other one.
pub(in crate::site) fn read_sequence(
    file: SourceFile<'_>,
    bytes: &[u8],
    how: How<'_>,
    draft: &mut Draft,
    log: &mut Log,
) -> Result<Read, Full> {
    let mut context = Context::of(file, how, draft, log);
    let mut head: Option<(Option<Transform>, Option<Templates>)> = None;
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        if line.trim_ascii().is_empty() {
            continue;
        }
        if context.log.full() {
            break;
        }
        let Some(mut document) = context.parse(line, i + 1) else {
            if head.is_none() {
                break;
            }
            continue;
        };
        let Some((transform, templates)) = &head else {
            let Some(transform) = context.head(&document, i + 1) else { break };
            context.objects(&document, transform, document.templates.as_ref(), i + 1)?;
            context.read.format = context.read.format.replace("CityJSON", "CityJSONSeq");
            head = Some((transform, document.templates.take()));
            continue;
        };
        if document.kind == "CityJSONFeature" {
            context.objects(&document, *transform, templates.as_ref(), i + 1)?;
        } else {
            let message =
                format!("expected \"type\": \"CityJSONFeature\", found {:?}", document.kind);
            context.fault(i + 1, message);
        }
    }
    if head.is_none() && context.log.faults.is_empty() {
        let message = "empty; expected a CityJSON document on the first line";
        context.fault(1, message.to_owned());
    }
    Ok(context.read)
}

/// The materials that are there, by name; of several the last.
fn named(draft: &Draft) -> HashMap<String, u32> {
    draft.materials.iter().zip(0..).map(|(m, i)| (m.name.clone(), i)).collect()
}

impl Context<'_> {
    fn place(&self, line: usize, item: &str) -> Place {
        Place { file: self.file.to_owned(), line, column: 0, item: item.to_owned() }
    }

    fn fault(&mut self, line: usize, message: String) {
        let place = self.place(line, "");
        self.log.fault(place, message);
    }

    /// Parses JSON that begins on a line of the file (0: it is the file).
    fn parse(&mut self, bytes: &[u8], line: usize) -> Option<Document> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        match serde_json::from_slice(bytes) {
            Ok(document) => Some(document),
            Err(e) => {
                let mut place = self.place(line.max(1) + e.line().saturating_sub(1), "");
                place.column = e.column();
                let text = e.to_string();
                let text = text.split(" at line ").next().unwrap_or_default();
                self.log.fault(place, format!("not CityJSON that can be read: {text}"));
                None
            }
        }
    }

    /// Checks what a document says about itself; its transform if it can be used.
    fn head(&mut self, document: &Document, line: usize) -> Option<Option<Transform>> {
        if document.kind != "CityJSON" {
            self.fault(
                line,
                format!(
                    "expected \"type\": \"CityJSON\", found {:?}: is it a CityJSON file?",
                    document.kind
                ),
            );
            return None;
        }
        let version = document.version.as_ref().map_or("", |v| &v.0);
        let known = ["1.0", "1.1", "2.0"];
        let family = known.iter().find(|k| {
            version.strip_prefix(**k).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        });
        let Some(family) = family.or_else(|| known.iter().find(|_| version == "1")) else {
            self.fault(line, format!(
                "CityJSON version {version:?}; this program reads 1.0, 1.1 and 2.0: convert it with cjio's `upgrade`"
            ));
            return None;
        };
        self.read.format = format!("CityJSON {family}");
        self.read.crs =
            document.metadata.as_ref().and_then(|m| m.crs.as_ref()).map(|c| c.0.clone());
        match document.transform {
            None if *family != "1.0" => {
                self.fault(line, format!(
                    "no `transform`; CityJSON {family} needs one (scale and translate of the vertices)"
                ));
                None
            }
            Some(t) if t.scale.contains(&0.0) => {
                self.fault(line, "transform/scale: expected numbers other than 0".to_owned());
                None
            }
            transform => Some(transform),
        }
    }

    fn objects(
        &mut self,
        document: &Document,
        transform: Option<Transform>,
        templates: Option<&Templates>,
        line: usize,
    ) -> Result<(), Full> {
        let Some(objects) = &document.objects else {
            self.fault(line, "no `CityObjects`".to_owned());
            return Ok(());
        };
        for id in &objects.repeated {
            let message = format!("CityObjects/{id}: the id occurs twice; ids are unique");
            let place = self.place(line, id);
            self.log.fault(place, message);
        }
        let vertices = self.vertices(document.vertices.as_deref().unwrap_or(&[]), transform, line);
        self.read.objects += objects.entries.len();
        let chosen: HashMap<&str, Choice> = objects
            .entries
            .iter()
            .map(|(id, object)| (id.as_str(), choose(object, templates, self.wanted)))
            .collect();
        for (id, object) in &objects.entries {
            if !self.read.ids.insert(id.clone()) {
                let message = format!("CityObjects/{id}: an earlier feature has the same id");
                let place = self.place(line, id);
                self.log.fault(place, message);
            }
            self.family(id, object);
            self.object(id, object, &chosen, &vertices, templates, line)?;
            if self.log.full() {
                break;
            }
        }
        Ok(())
    }

    fn vertices(
        &mut self,
        raw: &[[f64; 3]],
        transform: Option<Transform>,
        line: usize,
    ) -> Vec<DVec3> {
        let unit = Transform { scale: [1.0; 3], translate: [0.0; 3] };
        let Transform { scale, translate } = transform.unwrap_or(unit);
        let (scale, translate) = (DVec3::from(scale), DVec3::from(translate));
        let out: Vec<DVec3> = raw.iter().map(|&v| DVec3::from(v) * scale + translate).collect();
        if let Some(i) = out.iter().position(|&v| !in_reach(v)) {
            self.fault(line, format!("vertices[{i}]: too large a number"));
            return Vec::new();
        }
        out
    }

    fn family(&mut self, id: &str, object: &CityObject) {
        let mut link = |parent: &str, child: &str| {
            let known = self.draft.children.entry(parent.to_owned()).or_default();
            // An object and its part name each other: once is enough.
            if known.last().is_none_or(|c| c != child) {
                known.push(child.to_owned());
            }
        };
        for child in object.children.iter().flatten() {
            link(id, child);
        }
        for parent in object.parents.iter().flatten() {
            link(parent, id);
        }
    }

    fn object(
        &mut self,
        id: &str,
        object: &CityObject,
        chosen: &HashMap<&str, Choice>,
        vertices: &[DVec3],
        templates: Option<&Templates>,
        line: usize,
    ) -> Result<(), Full> {
        let mut seen = HashSet::new();
        for geometry in object.geometry.iter().flatten() {
            let lod = lod_of(geometry, templates);
            if seen.insert(lod.to_owned()) {
                *self.read.lods.entry(lod.to_owned()).or_default() += 1;
            }
        }
        let Some(choice) = chosen.get(id) else { return Ok(()) };
        let Some(lod) = &choice.lod else { return Ok(()) };
        if self.refined(object, chosen, choice) {
            return Ok(());
        }
        self.read.other_lod += usize::from(!choice.as_asked);
        let mut builder = Builder {
            file: self.file,
            line,
            source: self.source,
            material: self.material,
            materials: &mut self.materials,
            id,
            kind: &object.kind,
            known: Vec::new(),
            draft: self.draft,
            log: self.log,
        };
        let plain = |v: u32| vertices.get(v as usize).copied();
        for (g, geometry) in object.geometry.iter().flatten().enumerate() {
            if lod_of(geometry, templates) != lod {
                continue;
            }
            let path = format!("geometry[{g}]");
            if geometry.kind == "GeometryInstance" {
                instance(&mut builder, geometry, &path, vertices, templates)?;
            } else if depth_of(&geometry.kind).is_some() {
                let shell = Shell { geometry, path, vertex: &plain, vertices: vertices.len() };
                builder.add(&shell)?;
            } else if matches!(geometry.kind.as_str(), "MultiPoint" | "MultiLineString") {
                self.read.unread += 1;
            } else {
                let message = format!("unknown geometry type {:?}", geometry.kind);
                builder.fault(&format!("{path}/type"), &message);
            }
        }
        Ok(())
    }

    /// Whether an object's parts say more precisely what it looks like (3DBAG: a building has its
    /// footprint, its parts the solids); then its own geometry would lie double.
    fn refined(&self, object: &CityObject, chosen: &HashMap<&str, Choice>, own: &Choice) -> bool {
        object
            .children
            .iter()
            .flatten()
            .filter_map(|child| chosen.get(child.as_str()))
            .any(|child| child.part && child.rank > own.rank)
    }
}

fn instance(
    builder: &mut Builder<'_>,
    geometry: &Geometry,
    path: &str,
    vertices: &[DVec3],
    templates: Option<&Templates>,
) -> Result<(), Full> {
    let list = templates.map_or(&[][..], |t| &t.templates);
    let Some(template) = geometry.template.and_then(|i| list.get(i)) else {
        let message = format!("expected a template below {}, their number", list.len());
        builder.fault(&format!("{path}/template"), &message);
        return Ok(());
    };
    let super::model::Nest::Row(row) = &geometry.boundaries else {
        builder.fault(&format!("{path}/boundaries"), "expected one vertex index");
        return Ok(());
    };
    let at = row.first().and_then(|&v| vertices.get(v as usize)).copied();
    let matrix = at.and_then(|at| template_matrix(geometry.matrix.as_deref()?, at));
    let Some(matrix) = matrix else {
        let message = "expected a vertex index in `boundaries` and 16 numbers in `transformationMatrix`, the last four 0 0 0 1";
        builder.fault(path, message);
        return Ok(());
    };
    let local = templates.map_or(&[][..], |t| &t.vertices);
    let vertex = |v: u32| {
        let moved = matrix.transform_point3(DVec3::from(*local.get(v as usize)?));
        in_reach(moved).then_some(moved)
    };
    builder.add(&Shell {
        geometry: template,
        path: format!("{path}/template"),
        vertex: &vertex,
        vertices: local.len(),
    })
}

/// Which level of detail of an object is read.
struct Choice {
    /// `None`: it has no geometry.
    lod: Option<String>,
    rank: f64,
    as_asked: bool,
    /// Whether it is a part that stands for its parent, not something added to it (a dormer).
    part: bool,
}

fn lod_of<'a>(geometry: &'a Geometry, templates: Option<&'a Templates>) -> &'a str {
    let own = geometry.lod.as_ref();
    let template = || templates?.templates.get(geometry.template?)?.lod.as_ref();
    own.or_else(template).map_or("", |l| l.0.as_str())
}

fn rank(lod: &str) -> f64 {
    lod.parse::<f64>().ok().filter(|v| v.is_finite()).unwrap_or(-1.0)
}

/// The level that was asked for; else the highest below it, else the lowest above it. Without a
/// wish the highest.
fn choose(object: &CityObject, templates: Option<&Templates>, wanted: Option<&str>) -> Choice {
    let geometries = object.geometry.iter().flatten();
    let surfaces = geometries
        .filter(|g| g.kind == "GeometryInstance" || depth_of(&g.kind).is_some())
        .map(|g| lod_of(g, templates));
    let better = |best: &str, new: &str| {
        let (b, n) = (rank(best), rank(new));
        match wanted.map(rank) {
            None => n > b,
            Some(w) if b <= w => n > b && n <= w,
            Some(_) => n < b,
        }
    };
    let lod = surfaces.reduce(|best, new| if better(best, new) { new } else { best });
    let rank_of = lod.map_or(f64::NEG_INFINITY, rank);
    let as_asked = match (wanted, lod) {
        (Some(w), Some(l)) => w == l || (rank(w) >= 0.0 && rank(w) == rank_of),
        _ => true,
    };
    // Objects of points or lines alone still count as read.
    let any = || object.geometry.iter().flatten().next().map(|g| lod_of(g, templates));
    let part = lod.is_some() && object.kind.ends_with("Part");
    Choice { lod: lod.or_else(any).map(str::to_owned), rank: rank_of, as_asked, part }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(lods: &[&str], wanted: Option<&str>) -> (Option<String>, bool) {
        let geometry: Vec<String> = lods
            .iter()
            .map(|l| format!(r#"{{"type":"Solid","lod":{l},"boundaries":[]}}"#))
            .collect();
        let text = format!(r#"{{"type":"Building","geometry":[{}]}}"#, geometry.join(","));
        let object = serde_json::from_str(&text).unwrap();
        let choice = choose(&object, None, wanted);
        (choice.lod, choice.as_asked)
    }

    #[test]
    fn one_level_of_detail_for_each_object() {
        let lods = ["\"1.2\"", "\"1.3\"", "\"2.2\""];
        assert_eq!(chosen(&lods, None), (Some("2.2".into()), true));
        assert_eq!(chosen(&lods, Some("1.2")), (Some("1.2".into()), true));
        assert_eq!(chosen(&lods, Some("2")), (Some("1.3".into()), false));
        assert_eq!(chosen(&lods, Some("0")), (Some("1.2".into()), false));
        // CityJSON 1.0 writes numbers.
        assert_eq!(chosen(&["1", "2"], Some("2.0")), (Some("2".into()), true));
        assert_eq!(chosen(&[], None), (None, true));
    }
}
