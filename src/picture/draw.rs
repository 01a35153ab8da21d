use std::path::Path;

use super::canvas::Canvas;
use super::compose::{colored, enlarge, greyed, same_size};
use super::layout::Layout;
use super::text::Lettering;
use super::{Error, Figure, legend, marks, png};
use crate::base::Grid;

impl Figure<'_> {
    /// Draws the figure.
    ///
    /// # Errors
    /// [`Error::Setting`] for a scale that can't be used, [`Error::Size`] for a background of
    /// another size.
    pub fn draw(&self) -> Result<Grid<[u8; 3]>, Error> {
        if let Some(background) = self.background {
            same_size("the background", background, "the data", self.data)?;
        }
        let letters = Lettering::new();
        let layout = Layout::of(self, &letters);
        let colors = colored(self.data, &self.scale, self.contours)?;
        let under = self.background.map(greyed);
        let opacity = self.opacity.clamp(0.0, 1.0);
        let picture = enlarge(&colors, under.as_ref(), layout.factor, opacity);

        let mut canvas = Canvas::new(layout.width, layout.height, super::canvas::WHITE);
        for y in 0..picture.rows() {
            for (x, &color) in picture.row(y).iter().enumerate() {
                canvas.set(layout.picture.x + x as i64, layout.picture.y + y as i64, color);
            }
        }
        marks::draw(&mut canvas, self, &layout, &letters);
        if let Some(block) = &layout.legend {
            legend::draw(&mut canvas, self, block, layout.em, &letters);
        }
        layout.draw_texts(&mut canvas, &letters);
        Ok(canvas.into_pixels())
    }

    /// Draws the figure into a PNG, with `texts` (provenance) as text chunks.
    ///
    /// # Errors
    /// As [`Figure::draw`] and [`png::write`].
    pub fn write_png(&self, path: &Path, texts: &[(String, String)]) -> Result<(), Error> {
        png::write(path, &self.draw()?, texts)
    }
}
