//! What a file's elements hold, and what follows from it.

use std::borrow::Cow;

use roxmltree::Node;

use super::file::{Block, Spectrum, Table, Way};

/// An element's text without its comments, and where its pieces stand in the file.
pub(super) struct Content<'a> {
    pub text: Cow<'a, str>,
    /// Where a piece begins in `text`, and in the file.
    pieces: Vec<(usize, usize)>,
}

impl<'a> Content<'a> {
    /// `None` where elements stand among the text.
    pub(super) fn of(node: Node<'a, '_>) -> Option<Self> {
        let mut out = Self { text: Cow::Borrowed(""), pieces: vec![(0, node.range().start)] };
        for piece in node.children().filter(|c| !c.is_comment() && !c.is_pi()) {
            let text = piece.text().filter(|_| piece.is_text())?;
            out.pieces.push((out.text.len(), piece.range().start));
            if out.text.is_empty() {
                out.text = Cow::Borrowed(text);
            } else {
                out.text.to_mut().push_str(text);
            }
        }
        Some(out)
    }

    /// Place in the file of a byte of the text.
    pub(super) fn byte(&self, at: usize) -> usize {
        let after = self.pieces.partition_point(|p| p.0 <= at).max(1);
        let (begins, stands) = self.pieces[after - 1];
        stands + at - begins
    }
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
