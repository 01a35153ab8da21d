use super::Figure;
use super::canvas::{Canvas, INK, Rect, SOFT_INK};
use super::legend::{Block, Side};
use super::text::{Lettering, SetLine, Style, Weight};

/// Width that a small picture is enlarged to, about.
const WIDTH: f64 = 900.0;
/// Height beyond which a picture isn't enlarged.
const HEIGHT: f64 = 1800.0;

/// From one line of a paragraph to the next, ems.
const LEADING: f64 = 1.36;

/// Where everything lies on the sheet, in pixels of the sheet.
pub(super) struct Layout {
    pub width: usize,
    pub height: usize,
    /// Pixels of the sheet for each pixel of the data.
    pub factor: usize,
    /// Letter size (em).
    pub em: f64,
    pub picture: Rect,
    /// The legend's block, if there is one.
    pub legend: Option<Block>,
    /// Base line of the labels below the picture.
    pub axis_y: f64,
    texts: Vec<SetLine>,
}

impl Layout {
    pub(super) fn of(figure: &Figure<'_>, letters: &Lettering) -> Self {
        let (columns, rows) = (figure.data.columns().max(1), figure.data.rows().max(1));
        let factor = factor(columns, rows);
        let (width, height) = ((columns * factor) as f64, (rows * factor) as f64);
        // Tall pictures get letters by their height, or a strip would have none to speak of.
        let em = (width.max(0.5 * height) / 60.0).clamp(13.0, 110.0);
        let margin = (1.6 * em).round();
        let legend = Block::of(figure, letters, em, width, height);
        let side = legend.as_ref().filter(|b| b.side == Side::Right);
        let below = legend.as_ref().filter(|b| b.side == Side::Below);
        let beside = side.map_or(0.0, |b| b.width + 1.3 * em);
        // Narrow pictures keep a sheet that is wide enough for words.
        let content = (width + beside).max(below.map_or(0.0, |b| b.width)).max(26.0 * em).round();

        let mut texts = Vec::new();
        let mut y = margin;
        let title = Style::new(1.5 * em, INK).bold();
        let subtitle = Style::new(em, SOFT_INK);
        for (text, style) in [(&figure.title, title), (&figure.subtitle, subtitle)] {
            y = place(&mut texts, letters, text, style, (margin, y), content);
        }
        if y > margin {
            y += 0.7 * em;
        }
        let left = margin + ((content - width - beside) / 2.0).floor().max(0.0);
        let picture = Rect {
            x: left as i64,
            y: y.round() as i64,
            width: width as i64,
            height: height as i64,
        };
        let side_bottom = side.map_or(0.0, |b| b.height);
        y = y.round() + height;
        let mut axis_y = y;
        if !figure.axis.is_empty() {
            axis_y = y + 1.55 * em;
            y += 1.9 * em;
        }
        let mut legend_at = (picture.right() as f64 + 1.3 * em, picture.y as f64);
        if let Some(block) = below {
            y += 1.2 * em;
            legend_at = (left, y);
            y += block.height;
        }
        y = y.max(picture.y as f64 + side_bottom);
        if figure.caption.iter().any(|c| !c.is_empty()) {
            y += 0.8 * em;
            for paragraph in &figure.caption {
                let style = Style::new(0.82 * em, SOFT_INK);
                y = place(&mut texts, letters, paragraph, style, (margin, y), content);
            }
        }
        let legend = legend.map(|block| block.moved(legend_at));
        Self {
            width: (content + 2.0 * margin) as usize,
            height: (y + margin).ceil() as usize,
            factor,
            em,
            picture,
            legend,
            axis_y,
            texts,
        }
    }

    /// A place on the sheet from one in the data.
    pub(super) fn sheet(&self, [column, row]: [f64; 2]) -> (f64, f64) {
        let factor = self.factor as f64;
        (self.picture.x as f64 + column * factor, self.picture.y as f64 + row * factor)
    }

    pub(super) fn draw_texts(&self, canvas: &mut Canvas, letters: &Lettering) {
        letters.draw_all(canvas, &self.texts);
    }
}

/// Sets a paragraph; a little more space follows bold ones.
fn place(
    texts: &mut Vec<SetLine>,
    letters: &Lettering,
    text: &str,
    style: Style,
    at: (f64, f64),
    width: f64,
) -> f64 {
    let space = if style.weight == Weight::Bold && !text.is_empty() { 0.1 } else { 0.0 };
    letters.set(texts, text, style, at, (width, LEADING)) + space * style.size
}

fn factor(columns: usize, rows: usize) -> usize {
    let wide = (WIDTH / columns as f64).ceil();
    let tall = (HEIGHT / rows as f64).floor();
    wide.min(tall).max(1.0) as usize
}
