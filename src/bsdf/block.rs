use super::klems::Matrix;
use super::tree::Tree;

/// Which light a block is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Spectrum {
    /// What eyes see of it.
    Visible,
    /// The whole solar spectrum.
    Solar,
}

/// Which side of the sample is PV. The names of blocks are WINDOW's, whose front is the exterior;
/// Radiance calls the interior front (the side that a surface's normal points to).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Radiance's front: `Reflection Back`, "interior" in checkBSDF. What a PV surface shows
    /// whose Radiance material is this file, and what genBSDF, bsdf2ttree and pabopto2bsdf write
    /// for samples measured from above.
    #[default]
    Front,
    /// Radiance's back: `Reflection Front`, "exterior" in checkBSDF; WINDOW's outward side.
    Back,
}

/// Which way light goes in a block, in WINDOW's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// From the exterior to the interior.
    TransmissionFront,
    /// From the interior to the exterior.
    TransmissionBack,
    /// Reflected by the exterior side.
    ReflectionFront,
    /// Reflected by the interior side, Radiance's front.
    ReflectionBack,
}

impl Way {
    pub(super) const ALL: [(Self, &str); 4] = [
        (Self::TransmissionFront, "Transmission Front"),
        (Self::TransmissionBack, "Transmission Back"),
        (Self::ReflectionFront, "Reflection Front"),
        (Self::ReflectionBack, "Reflection Back"),
    ];

    /// As files call it.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|w| w.0 == self).map_or("", |w| w.1)
    }
}

/// How a block's values are laid out.
#[derive(Clone, Debug, PartialEq)]
pub enum Table {
    /// Patches to patches.
    Matrix(Matrix),
    /// A tensor tree.
    Tree(Tree),
}

/// One block of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Which light.
    pub spectrum: Spectrum,
    /// Which way.
    pub way: Way,
    /// The values, ready to evaluate and to sample.
    pub table: std::sync::Arc<Table>,
    /// Largest share of light that the file's values scatter, before it was cut to 1.
    pub most_scattered: f64,
    /// Taken from the other direction, as light may go either way: the file hasn't it.
    pub reciprocal: bool,
}

/// Adds the transmission that a file leaves out: light may go either way, so that the one from
/// the front also tells the one from the back (as Radiance has it).
pub(super) fn fill_in(blocks: &mut Vec<Block>, notes: &mut Vec<String>) {
    for spectrum in [Spectrum::Visible, Spectrum::Solar] {
        for (have, lack) in [
            (Way::TransmissionFront, Way::TransmissionBack),
            (Way::TransmissionBack, Way::TransmissionFront),
        ] {
            let find = |way| blocks.iter().find(|b| b.spectrum == spectrum && b.way == way);
            let (Some(block), None) = (find(have), find(lack)) else { continue };
            let Table::Matrix(matrix) = &*block.table else {
                notes.push(format!(
                    "{spectrum:?} {} isn't there; by reciprocity it is {} read backwards",
                    lack.name(),
                    have.name()
                ));
                continue;
            };
            let matrix = matrix.backwards();
            let most_scattered =
                (0..matrix.incident.len()).map(|i| matrix.total(i)).fold(0.0, f64::max);
            notes.push(format!(
                "{spectrum:?} {} was taken from {} by reciprocity",
                lack.name(),
                have.name()
            ));
            let table = std::sync::Arc::new(Table::Matrix(matrix));
            let way = lack;
            blocks.push(Block { spectrum, way, table, most_scattered, reciprocal: true });
        }
    }
}
