//! The text of an XML element, without its comments.

use std::borrow::Cow;

use roxmltree::Node;

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
