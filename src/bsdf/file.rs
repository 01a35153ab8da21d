//! BSDF files as WINDOW and Radiance write them: XML with Klems matrices or tensor trees.
//!
//! The format has no specification beyond LBNL's examples and what Radiance's `bsdf.c` accepts, so
//! files differ: text before the XML, bases defined in the file under LBNL's names, comments within
//! the numbers, a transmission that is only given one way. The reader takes what Radiance takes,
//! says in [`BsdfFile::notes`] what it mended, and refuses the rest with the line, the element,
//! what was expected and what was found. All counts are claims and are bounded before they size
//! anything.

use std::path::Path;

use roxmltree::{Document, Node, ParsingOptions};

use super::block::{Block, Side, Spectrum, Table, Way, fill_in};
use super::content::Content;
use super::klems::{KlemsBasis, Matrix, Ring};
use super::numbers::{self, Wrong};
use super::tree::Tree;
use super::{Error, Measured};

/// Bytes of a BSDF file: 40 times the largest that the paper's makers use.
const MOST_BYTES: u64 = 512 << 20;
/// Nodes of a file's XML.
const MOST_NODES: u32 = 100_000;
/// Rings of a basis that a file defines, and patches of it.
const MOST_RINGS: usize = 90;
const MOST_PATCHES: usize = 4096;

/// A BSDF file as WINDOW and Radiance write it.
#[derive(Clone, Debug, PartialEq)]
pub struct BsdfFile {
    /// The file, as the user named it.
    pub path: String,
    /// Its material's name, or empty.
    pub name: String,
    /// Its material's maker, or empty.
    pub manufacturer: String,
    /// All blocks about visible or solar light.
    pub blocks: Vec<Block>,
    /// What was left out, mended or looks wrong.
    pub notes: Vec<String>,
}

struct Reader<'a, 'input> {
    path: &'a str,
    document: &'a Document<'input>,
    /// Lines before the XML begins.
    lines_before: u32,
    notes: Vec<String>,
}

impl BsdfFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Read`], and all of [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let name = path.display().to_string();
        let failed = |reason: String| Error::Read { path: name.clone(), reason };
        let length = std::fs::metadata(path).map_err(|e| failed(e.to_string()))?.len();
        if length > MOST_BYTES {
            return Err(failed(format!("{length} bytes; a BSDF file has at most {MOST_BYTES}")));
        }
        let bytes = std::fs::read(path).map_err(|e| failed(e.to_string()))?;
        Self::parse(&String::from_utf8_lossy(&bytes), &name)
    }

    /// Reads a file's text; `path` is for messages.
    ///
    /// # Errors
    /// [`Error::Xml`] for what is no XML, [`Error::File`] for what is no BSDF.
    pub fn parse(text: &str, path: &str) -> Result<Self, Error> {
        // Some programs write about themselves before the XML begins.
        let start = text.find("<?xml").or_else(|| text.find("<WindowElement")).unwrap_or(0);
        let (before, xml) = text.split_at(start);
        let lines_before = u32::try_from(before.matches('\n').count()).unwrap_or(0);
        let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(xml, options).map_err(|e| Error::Xml {
            path: path.to_owned(),
            line: e.pos().row + lines_before,
            column: e.pos().col,
            reason: e.to_string(),
        })?;
        let mut reader = Reader { path, document: &document, lines_before, notes: Vec::new() };
        if before.trim_start_matches('\u{feff}').trim() != "" {
            reader.notes.push(format!("{} lines before the XML were skipped", lines_before.max(1)));
        }
        reader.file()
    }

    /// The reflection of a side, ready to scatter light: of `spectrum`, or visible, or solar.
    ///
    /// # Errors
    /// [`Error::NoReflection`] where the file doesn't hold it.
    pub fn reflection(&self, side: Side, spectrum: Option<Spectrum>) -> Result<Measured, Error> {
        let way = match side {
            Side::Front => Way::ReflectionBack,
            Side::Back => Way::ReflectionFront,
        };
        let find = |s| self.blocks.iter().find(|b| b.way == way && b.spectrum == s);
        let block = match spectrum {
            Some(s) => find(s),
            None => find(Spectrum::Visible).or_else(|| find(Spectrum::Solar)),
        };
        let block = block.ok_or_else(|| {
            let list: Vec<String> =
                self.blocks.iter().map(|b| format!("{:?} {}", b.spectrum, b.way.name())).collect();
            Error::NoReflection {
                path: self.path.clone(),
                wanted: format!(
                    "`{}`{}",
                    way.name(),
                    spectrum.map_or(String::new(), |s| format!(" for {s:?}"))
                ),
                found: if list.is_empty() { "nothing".into() } else { list.join(", ") },
            }
        })?;
        Ok(Measured::new(block.table.clone(), side == Side::Back))
    }
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.has_tag_name(name) || c.tag_name().name() == name)
}

fn children<'a, 'i: 'a>(node: Node<'a, 'i>, name: &'a str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |c| c.tag_name().name() == name)
}

fn text<'a>(node: Option<Node<'a, '_>>) -> &'a str {
    node.and_then(|n| n.text()).map_or("", str::trim)
}

fn shown(text: &str) -> String {
    let mut out: String = text.chars().take(40).collect();
    if out.len() < text.len() {
        out.push('…');
    }
    if out.is_empty() { "nothing".into() } else { format!("`{out}`") }
}

impl Reader<'_, '_> {
    fn line(&self, byte: usize) -> u32 {
        self.document.text_pos_at(byte).row + self.lines_before
    }

    fn wrong(&self, at: Node, item: &str, expected: &str, found: impl Into<String>) -> Error {
        Error::File {
            path: self.path.to_owned(),
            line: self.line(at.range().start),
            item: item.into(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    fn file(mut self) -> Result<BsdfFile, Error> {
        let root = self.document.root_element();
        if root.tag_name().name() != "WindowElement" {
            let found = format!("<{}>", root.tag_name().name());
            return Err(self.wrong(root, "root", "<WindowElement>, a BSDF file", found));
        }
        let optical = child(root, "Optical")
            .ok_or_else(|| self.wrong(root, "WindowElement", "<Optical>", "none"))?;
        let layers: Vec<Node> = children(optical, "Layer").collect();
        let layer =
            *layers.iter().find(|l| child(**l, "WavelengthData").is_some()).ok_or_else(|| {
                self.wrong(optical, "Optical", "a <Layer> with <WavelengthData>", "none")
            })?;
        if layers.len() > 1 {
            self.notes.push(format!("{} layers; the first with data is read", layers.len()));
        }
        let material = child(layer, "Material");
        let about = |name| text(material.and_then(|m| child(m, name))).to_owned();
        if child(layer, "Geometry").is_some_and(|g| g.children().any(|c| c.is_element())) {
            self.notes.push("the geometry inside is ignored: only its scattering counts".into());
        }
        let definition = child(layer, "DataDefinition")
            .ok_or_else(|| self.wrong(layer, "Layer", "<DataDefinition>", "none"))?;
        let structure = text(child(definition, "IncidentDataStructure"));
        let rank = match structure.to_ascii_lowercase().as_str() {
            "columns" | "rows" => 0,
            "tensortree3" => 3,
            "tensortree4" => 4,
            _ => {
                return Err(self.wrong(
                    definition,
                    "IncidentDataStructure",
                    "Columns, Rows, TensorTree3 or TensorTree4",
                    shown(structure),
                ));
            }
        };
        let by_rows = structure.eq_ignore_ascii_case("rows");
        let bases = children(definition, "AngleBasis")
            .map(|n| self.basis(n))
            .collect::<Result<Vec<_>, _>>()?;
        let mut blocks: Vec<Block> = Vec::new();
        for data in children(layer, "WavelengthData") {
            let wavelength = text(child(data, "Wavelength"));
            let spectrum = match wavelength.to_ascii_lowercase().as_str() {
                "visible" => Spectrum::Visible,
                "solar" => Spectrum::Solar,
                _ => {
                    let note = format!("data for {} were skipped", shown(wavelength));
                    if !self.notes.contains(&note) {
                        self.notes.push(note);
                    }
                    continue;
                }
            };
            for block in children(data, "WavelengthDataBlock") {
                let block = self.block(block, spectrum, rank, by_rows, &bases)?;
                if blocks.iter().any(|b| b.spectrum == spectrum && b.way == block.way) {
                    return Err(self.wrong(
                        data,
                        "WavelengthDataDirection",
                        "each direction once for each spectrum",
                        format!("a second {:?} {}", spectrum, block.way.name()),
                    ));
                }
                blocks.push(block);
            }
        }
        if blocks.is_empty() {
            return Err(self.wrong(layer, "WavelengthData", "Visible or Solar data", "none"));
        }
        fill_in(&mut blocks, &mut self.notes);
        Ok(BsdfFile {
            path: self.path.to_owned(),
            name: about("Name"),
            manufacturer: about("Manufacturer"),
            blocks,
            notes: self.notes,
        })
    }

    /// A basis as a file defines it. LBNL's names mean LBNL's bases, whatever the file says.
    fn basis(&mut self, node: Node) -> Result<KlemsBasis, Error> {
        let name = text(child(node, "AngleBasisName"));
        let mut rings = Vec::new();
        let mut from_deg = 0.0;
        for block in children(node, "AngleBasisBlock") {
            let bounds = child(block, "ThetaBounds");
            let number = |n: Option<Node>| text(n).parse::<f64>().ok();
            let lower = number(bounds.and_then(|b| child(b, "LowerTheta")));
            let upper = number(bounds.and_then(|b| child(b, "UpperTheta")));
            let patches = text(child(block, "nPhis")).parse::<usize>().ok();
            let good = lower.zip(upper).zip(patches).filter(|&((lower, upper), patches)| {
                (lower - from_deg).abs() < 1e-3
                    && upper > lower
                    && upper <= 90.0
                    && (1..=MOST_PATCHES).contains(&patches)
                    && rings.len() < MOST_RINGS
            });
            let Some(((_, to_deg), patches)) = good else {
                return Err(self.wrong(
                    block,
                    "AngleBasisBlock",
                    &format!(
                        "a LowerTheta of {from_deg}, a larger UpperTheta up to 90, and nPhis from 1 to {MOST_PATCHES}"
                    ),
                    format!("{lower:?}, {upper:?} and {patches:?}"),
                ));
            };
            rings.push(Ring { from_deg, to_deg, patches });
            from_deg = to_deg;
        }
        let patches: usize = rings.iter().map(|r| r.patches).sum();
        if let Some(known) = KlemsBasis::known(name) {
            if !rings.is_empty() && known.rings() != rings {
                self.notes.push(format!(
                    "the file's definition of {name} isn't LBNL's; LBNL's is used, as Radiance does"
                ));
            }
            return Ok(known);
        }
        if rings.is_empty() || patches > MOST_PATCHES {
            return Err(self.wrong(
                node,
                "AngleBasis",
                &format!("1 to {MOST_PATCHES} patches"),
                patches.to_string(),
            ));
        }
        Ok(KlemsBasis::of(name, rings))
    }

    fn named(&self, node: Node, item: &str, bases: &[KlemsBasis]) -> Result<KlemsBasis, Error> {
        let name = text(child(node, item));
        bases
            .iter()
            .find(|b| b.name.eq_ignore_ascii_case(name))
            .cloned()
            .or_else(|| KlemsBasis::known(name))
            .ok_or_else(|| {
                self.wrong(
                    node,
                    item,
                    "LBNL/Klems Full, Half or Quarter, or a basis that the file defines",
                    shown(name),
                )
            })
    }

    fn block(
        &mut self,
        node: Node,
        spectrum: Spectrum,
        rank: usize,
        by_rows: bool,
        bases: &[KlemsBasis],
    ) -> Result<Block, Error> {
        let direction = text(child(node, "WavelengthDataDirection"));
        let way =
            Way::ALL.iter().find(|w| w.1.eq_ignore_ascii_case(direction)).map(|w| w.0).ok_or_else(
                || {
                    self.wrong(
                    node,
                    "WavelengthDataDirection",
                    "Transmission Front, Transmission Back, Reflection Front or Reflection Back",
                    shown(direction),
                )
                },
            )?;
        let data = child(node, "ScatteringData")
            .ok_or_else(|| self.wrong(node, "WavelengthDataBlock", "<ScatteringData>", "none"))?;
        let item = format!("ScatteringData of {spectrum:?} {}", way.name());
        let Some(content) = Content::of(data) else {
            return Err(self.wrong(data, &item, "numbers alone", "elements among them"));
        };
        let numbers = &*content.text;
        let failed = |wrong: Wrong| Error::File {
            path: self.path.to_owned(),
            line: self.line(content.byte(wrong.byte).min(self.document.input_text().len())),
            item: item.as_str().into(),
            expected: wrong.expected.into(),
            found: wrong.found,
        };
        let (table, negative, most_scattered) = if rank == 0 {
            let incident = self.named(node, "ColumnAngleBasis", bases)?;
            let outgoing = self.named(node, "RowAngleBasis", bases)?;
            let (ni, no) = (incident.len(), outgoing.len());
            let (values, negative) = numbers::list(numbers, ni * no).map_err(failed)?;
            // By incident patch: files give rows of incident patches (Columns) or the reverse.
            let ordered = if by_rows {
                values
            } else {
                (0..ni * no).map(|k| values[(k % no) * ni + k / no]).collect()
            };
            let most = ordered
                .chunks(no)
                .map(|c| {
                    c.iter()
                        .enumerate()
                        .map(|(o, &f)| f64::from(f) * outgoing.projected_sr(o))
                        .sum()
                })
                .fold(0.0, f64::max);
            (Table::Matrix(Matrix::new(incident, outgoing, ordered)), negative, most)
        } else {
            let basis = text(child(node, "AngleBasis"));
            if !basis.eq_ignore_ascii_case("LBNL/Shirley-Chiu") {
                return Err(self.wrong(node, "AngleBasis", "LBNL/Shirley-Chiu", shown(basis)));
            }
            let read = numbers::tree(numbers, rank).map_err(failed)?;
            let tree = Tree::new(read.raw, read.levels).ok_or_else(|| {
                self.wrong(data, &item, "a tree that can be sampled in 512 MiB", "a larger one")
            })?;
            let most = tree.most_in_file();
            (Table::Tree(tree), read.negative, most)
        };
        if negative > 0 {
            self.notes.push(format!("{item}: {negative} negative values were taken as 0"));
        }
        if most_scattered > 1.0 + 1e-6 {
            self.notes.push(format!(
                "{item}: up to {:.2} % of the light would be scattered; what is above 100 % was scaled down",
                100.0 * most_scattered
            ));
        }
        Ok(Block {
            spectrum,
            way,
            table: std::sync::Arc::new(table),
            most_scattered,
            reciprocal: false,
        })
    }
}
