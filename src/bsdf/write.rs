//! BSDF files of our own: tensor trees as Radiance's `bsdf2ttree` and `rttree_reduce` write them.

use std::fmt::Write as _;

use super::cells::{Cells, Closeness};
use super::gonio::Goniophotometer;
use super::survey::ANGLES_DEG;
use super::{Bsdf, Error, Interpolation, Table};

/// How a file is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Directions along each edge of the square: 2 to this power. 7 in the paper.
    pub resolution: u32,
    /// Share of the finest nodes that are merged, %: 80 in the paper.
    pub prune: f64,
}

impl Default for Fineness {
    fn default() -> Self {
        Self { resolution: 7, prune: 80.0 }
    }
}

/// What pruning does at one angle.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cost {
    /// Incidence.
    pub angle_deg: f64,
    /// Angles that share one cell of the file with it.
    pub cell_deg: (f64, f64),
    /// Largest value, 1/sr, of all cells.
    pub peak_per_sr: f64,
    /// What pruning leaves of it.
    pub pruned_per_sr: f64,
    /// Share of the light that is scattered, in the mean over the cell.
    pub scattered: f64,
    /// The same after pruning.
    pub pruned_scattered: f64,
}

/// A written file.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Written {
    /// The XML.
    #[serde(skip)]
    pub text: String,
    /// 3 where isotropic, else 4.
    pub rank: usize,
    /// Cells per coordinate are 2 to this power.
    pub resolution: u32,
    /// Cells in all, before pruning.
    pub cells: usize,
    /// Values in the file.
    pub values: usize,
    /// Largest correction for the quadrature inside cells, as a share.
    pub corrected: f64,
    /// By incidence.
    pub costs: Vec<Cost>,
}

impl Written {
    /// For people.
    pub fn told(&self) -> String {
        let mut out = format!(
            "tensor tree of rank {}, 2^{} cells an edge, {} values for {} cells, {:.1} MB\n",
            self.rank,
            self.resolution,
            self.values,
            self.cells,
            self.text.len() as f64 / 1e6
        );
        // Writing into a String can't fail.
        let _ =
            writeln!(out, "    incidence (its cell)      reflects  pruned    peak 1/sr  pruned");
        for c in &self.costs {
            let _ = writeln!(
                out,
                "    {:>4}° ({:>4.1}° to {:>4.1}°)   {:>6.2} %  {:>6.2} %  {:>9.3}  {:.3} ({:+.1} %)",
                c.angle_deg,
                c.cell_deg.0,
                c.cell_deg.1,
                100.0 * c.scattered,
                100.0 * c.pruned_scattered,
                c.peak_per_sr,
                c.pruned_per_sr,
                if c.peak_per_sr > 0.0 {
                    100.0 * (c.pruned_per_sr / c.peak_per_sr - 1.0)
                } else {
                    0.0
                }
            );
        }
        out
    }
}

/// Finest cells of rank 4: 2^24 of them.
const FINEST_4: u32 = 6;
/// Finest cells of rank 3: 2^27, half of them unused.
const FINEST_3: u32 = 9;

fn check(rank: usize, fineness: Fineness) -> Result<(), Error> {
    let model = "--write";
    let most = f64::from(if rank == 3 { FINEST_3 } else { FINEST_4 });
    let found = f64::from(fineness.resolution);
    if !(2.0..=most).contains(&found) {
        let field = if rank == 3 { "resolution" } else { "resolution (rank 4, not isotropic)" };
        return Err(Error::OutOfRange { model, field, low: 2.0, high: most, found });
    }
    if !(0.0..=99.9).contains(&fineness.prune) {
        let (field, found) = ("prune", fineness.prune);
        return Err(Error::OutOfRange { model, field, low: 0.0, high: 99.9, found });
    }
    Ok(())
}

/// A model or a measured reflection as a file: rank 3 where it is isotropic, else 4. `name` goes
/// into the file.
///
/// # Errors
/// [`Error::OutOfRange`] for a fineness that needs too much memory.
pub fn write(bsdf: &Bsdf, name: &str, fineness: Fineness) -> Result<Written, Error> {
    let rank = match bsdf {
        Bsdf::Measured(m) => match m.table() {
            Table::Tree(t) => t.rank(),
            Table::Matrix(_) => 4,
        },
        _ => 3,
    };
    check(rank, fineness)?;
    let closeness = match bsdf {
        Bsdf::Measured(_) => Closeness { incident: 2, deepest: 2 },
        _ => Closeness { incident: 4, deepest: 5 },
    };
    let cells = Cells::of(bsdf, rank, fineness.resolution, closeness);
    Ok(file(&cells, name, fineness.prune))
}

/// Goniophotometer data as a file: rank 3 where all light came in one plane, else 4.
///
/// # Errors
/// As [`write()`].
pub fn write_points(data: &Goniophotometer, fineness: Fineness) -> Result<Written, Error> {
    let rank = if data.is_isotropic() { 3 } else { 4 };
    check(rank, fineness)?;
    let surface = Interpolation::of(data);
    let closeness = Closeness { incident: 1, deepest: 1 };
    let value = |from, to| surface.value(from, to);
    let cells = Cells::sampled(rank, fineness.resolution, closeness, &value, None);
    Ok(file(&cells, &data.name, fineness.prune))
}

/// Extremes and mean of a node's cells.
#[derive(Clone, Copy)]
struct Node {
    low: f32,
    high: f32,
    mean: f32,
}

impl Node {
    /// How uneven it is: `rttree_reduce`'s measure.
    fn measure(&self) -> f32 {
        (self.high - self.low) / (self.mean.sqrt() + 0.03)
    }
}

struct Pruner {
    rank: usize,
    /// Nodes by level: `2^(rank level)` each, first coordinate slowest; the last ones are cells.
    levels: Vec<Vec<Node>>,
    threshold: f32,
    text: String,
    values: usize,
    /// Cells after pruning.
    pruned: Vec<f32>,
}

impl Pruner {
    fn new(cells: &Cells, prune: f64) -> Self {
        let rank = cells.rank;
        let mut levels = vec![
            cells.values.iter().map(|&v| Node { low: v, high: v, mean: v }).collect::<Vec<_>>(),
        ];
        for level in (0..cells.resolution).rev() {
            let below = &levels[levels.len() - 1];
            let count = 1_usize << (rank as u32 * level);
            let mut nodes = Vec::with_capacity(count);
            for n in 0..count {
                let at = coordinates(n, rank, level);
                let mut node = Node { low: f32::INFINITY, high: 0.0, mean: 0.0 };
                let mut sum = 0.0_f64;
                for child in 0..1_usize << rank {
                    let c = below[index(&child_at(&at, child), rank, level + 1)];
                    node.low = node.low.min(c.low);
                    node.high = node.high.max(c.high);
                    sum += f64::from(c.mean);
                }
                node.mean = (sum / f64::from(1_u32 << rank)) as f32;
                nodes.push(node);
            }
            levels.push(nodes);
        }
        levels.reverse();
        let mut measures: Vec<f32> =
            levels[cells.resolution as usize - 1].iter().map(Node::measure).collect();
        measures.sort_by(f32::total_cmp);
        let merged = (prune * 0.01 * measures.len() as f64).round() as usize;
        let threshold = if merged == 0 { 0.0 } else { measures[merged - 1] };
        let pruned = cells.values.clone();
        Self { rank, levels, threshold, text: String::new(), values: 0, pruned }
    }

    /// Writes a node; the first coordinate is a branch's lowest bit, and slowest in lists.
    fn node(&mut self, at: [usize; 4], level: u32) {
        let (rank, finest) = (self.rank, self.levels.len() as u32 - 1);
        let node = self.levels[level as usize][index(&at, rank, level)];
        for _ in 0..level {
            self.text.push(' ');
        }
        // Writing into a String can't fail.
        if node.measure() <= self.threshold {
            let _ = writeln!(self.text, "{{ {:.5e} }}", node.mean);
            self.values += 1;
            self.fill(at, level, node.mean);
        } else if level + 1 == finest {
            self.text.push('{');
            for child in 0..1_usize << rank {
                let slowest_first =
                    (0..rank).fold(0, |c, j| c | (child >> (rank - 1 - j) & 1) << j);
                let cell = index(&child_at(&at, slowest_first), rank, finest);
                let _ = write!(self.text, " {:.5e}", self.pruned[cell]);
            }
            self.text.push_str(" }\n");
            self.values += 1 << rank;
        } else {
            self.text.push_str("{\n");
            for child in 0..1_usize << rank {
                self.node(child_at(&at, child), level + 1);
            }
            for _ in 0..level {
                self.text.push(' ');
            }
            self.text.push_str("}\n");
        }
    }

    fn fill(&mut self, at: [usize; 4], level: u32, value: f32) {
        let finest = self.levels.len() as u32 - 1;
        if level == finest {
            self.pruned[index(&at, self.rank, finest)] = value;
        } else {
            for child in 0..1_usize << self.rank {
                self.fill(child_at(&at, child), level + 1, value);
            }
        }
    }
}

fn coordinates(n: usize, rank: usize, level: u32) -> [usize; 4] {
    let mut at = [0; 4];
    for (j, x) in at[..rank].iter_mut().enumerate() {
        *x = n >> ((rank - 1 - j) as u32 * level) & ((1 << level) - 1);
    }
    at
}

fn index(at: &[usize; 4], rank: usize, level: u32) -> usize {
    at[..rank].iter().fold(0, |n, x| (n << level) + x)
}

fn child_at(at: &[usize; 4], child: usize) -> [usize; 4] {
    let mut out = *at;
    for (j, x) in out.iter_mut().enumerate() {
        *x = 2 * *x + (child >> j & 1);
    }
    out
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn file(cells: &Cells, name: &str, prune: f64) -> Written {
    let mut pruner = Pruner::new(cells, prune);
    pruner.node([0; 4], 0);
    let after = Cells { values: std::mem::take(&mut pruner.pruned), ..cells.clone() };
    let most = |row: &[f32]| row.iter().fold(0.0_f64, |m, &v| m.max(f64::from(v)));
    let costs = ANGLES_DEG
        .map(|angle_deg| {
            let (row, pruned) = (cells.row_of(angle_deg), after.row_of(angle_deg));
            Cost {
                angle_deg,
                cell_deg: cells.incident_span_deg(angle_deg),
                peak_per_sr: most(row),
                pruned_per_sr: most(pruned),
                scattered: cells.scattered(row),
                pruned_scattered: after.scattered(pruned),
            }
        })
        .to_vec();
    let (rank, resolution) = (cells.rank, cells.resolution);
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <!-- glintmap {}: {}, 2^{resolution} cells, {prune} % pruned -->\n\
         <WindowElement xmlns=\"http://windows.lbl.gov\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:schemaLocation=\"http://windows.lbl.gov/BSDF-v1.4.xsd\">\n\
         <WindowElementType>System</WindowElementType>\n<FileType>BSDF</FileType>\n<Optical>\n<Layer>\n\
         \t<Material>\n\t\t<Name>{}</Name>\n\t\t<Manufacturer>glintmap</Manufacturer>\n\t\t<DeviceType>Other</DeviceType>\n\t</Material>\n\
         \t<DataDefinition>\n\t\t<IncidentDataStructure>TensorTree{rank}</IncidentDataStructure>\n\t</DataDefinition>\n\
         \t<WavelengthData>\n\t\t<LayerNumber>System</LayerNumber>\n\t\t<Wavelength unit=\"Integral\">Visible</Wavelength>\n\
         \t\t<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>\n\t\t<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>\n\
         \t\t<WavelengthDataBlock>\n\t\t\t<WavelengthDataDirection>Reflection Back</WavelengthDataDirection>\n\
         \t\t\t<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>\n\t\t\t<ScatteringDataType>BRDF</ScatteringDataType>\n\
         \t\t\t<ScatteringData>\n{}\t\t\t</ScatteringData>\n\t\t</WavelengthDataBlock>\n\t</WavelengthData>\n\
         </Layer>\n</Optical>\n</WindowElement>\n",
        env!("CARGO_PKG_VERSION"),
        escaped(name).replace("--", "- -"),
        escaped(name),
        pruner.text
    );
    Written {
        text,
        rank,
        resolution,
        cells: cells.values.len() / if rank == 3 { 2 } else { 1 },
        values: pruner.values,
        corrected: cells.corrected,
        costs,
    }
}
