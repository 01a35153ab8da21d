//! A page as data, and as HTML.

use std::path::Path;

use maud::{DOCTYPE, Markup, PreEscaped, html as markup};

/// A page: what it is about, its tables and its pictures.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// The site.
    pub title: String,
    /// One line below the title.
    pub subtitle: String,
    /// Whether nothing on the page may be used for an assessment.
    pub draft: bool,
    /// The parts, in order.
    pub sections: Vec<Section>,
    /// Small print: program, settings, seed.
    pub provenance: String,
}

/// A part of a page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Its heading.
    pub heading: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Sentences that stand one below the other, after the paragraphs.
    pub points: Vec<Point>,
    /// Parts of this part, under smaller headings.
    pub parts: Vec<Section>,
}

/// A sentence of a list.
#[derive(Clone, Debug, Default)]
pub struct Point {
    /// What it is about, in bold; may be empty.
    pub lead: String,
    /// The words.
    pub text: String,
    /// How it is marked.
    pub mark: Mark,
}

/// The colour of a sentence's mark; the words say the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// None.
    #[default]
    Plain,
    /// A limit is kept.
    Kept,
    /// A limit is exceeded.
    Exceeded,
    /// It isn't known, or the noise decides.
    Open,
}

impl Mark {
    fn class(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Kept => "kept",
            Self::Exceeded => "exceeded",
            Self::Open => "open",
        }
    }
}

/// A table; the first column names the row.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Column heads, with units.
    pub head: Vec<String>,
    /// Rows, as long as the head.
    pub rows: Vec<Vec<String>>,
}

/// A picture beside the page.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Its file, relative to the page.
    pub path: String,
    /// What it shows.
    pub caption: String,
}

/// How the page names a file of the run.
pub fn link(name: &Path) -> String {
    name.to_string_lossy().replace('\\', "/")
}

const STYLE: &str = "
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #ccc; }
.subtitle { color: #555; margin-top: .2rem; }
.draft { background: #fff3cd; border: 1px solid #e0c060; padding: .6rem 1rem; font-weight: 600; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .8rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 2px solid #888; vertical-align: bottom; }
h3 { margin: 1.8rem 0 .3rem; } h4 { margin: 1.2rem 0 .2rem; }
ul { padding: 0; } li { list-style: none; margin: .35rem 0; padding-left: .9rem; border-left: 5px solid #ccd; }
li.kept { border-color: #2e8b57; } li.exceeded { border-color: #c0392b; } li.open { border-color: #d9a520; }
figure { margin: 1.5rem 0; } figure img { max-width: 100%; height: auto; }
figcaption { color: #555; font-size: .95em; }
footer { margin-top: 3rem; color: #666; font-size: .85em; word-break: break-all; }
";

/// The page as HTML; everything in it is escaped.
pub fn html(document: &Document) -> String {
    let page: Markup = markup! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (document.title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (document.title) }
                p class="subtitle" { (document.subtitle) }
                @if document.draft {
                    p class="draft" { "Draft, not for assessment: there are too few photons for durations. Values that are integrated use no photons and are not affected." }
                }
                @for section in &document.sections { (part(section, 2)) }
                footer { (document.provenance) }
            }
        }
    };
    page.into_string()
}

fn part(section: &Section, level: u8) -> Markup {
    markup! {
        @match level {
            2 => h2 { (section.heading) },
            3 => h3 { (section.heading) },
            _ => h4 { (section.heading) },
        }
        @for text in &section.text { p { (text) } }
        @if !section.points.is_empty() {
            ul {
                @for point in &section.points {
                    li class=(point.mark.class()) {
                        @if !point.lead.is_empty() { b { (point.lead) } " " }
                        (point.text)
                    }
                }
            }
        }
        @for table in &section.tables {
            table {
                thead { tr { @for cell in &table.head { th { (cell) } } } }
                tbody {
                    @for row in &table.rows { tr { @for cell in row { td { (cell) } } } }
                }
            }
        }
        @for figure in &section.figures {
            figure {
                img src=(figure.path) alt=(figure.caption) loading="lazy";
                figcaption { (figure.caption) }
            }
        }
        @for inner in &section.parts { (part(inner, level + 1)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_from_outside_are_escaped() {
        let page = html(&Document {
            title: "<script>alert(1)</script>".into(),
            draft: true,
            ..Document::default()
        });
        assert!(!page.contains("<script>"));
        assert!(page.contains("&lt;script&gt;"));
        assert!(page.contains("not for assessment"));
    }
}
