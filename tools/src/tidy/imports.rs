//! Who uses whom, read off the syntax tree: `use` lines, paths in the code and in the arguments of
//! macros. What is compiled for tests only is left out.

use std::collections::{BTreeMap, BTreeSet};

use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::visit::Visit;

/// One path that a file names, with its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// From the root of the crate for our own (`["render", "view", "View"]`), else as written.
    pub path: Vec<String>,
    /// Whether it is a path of our own crate.
    pub ours: bool,
    /// From 1.
    pub line: usize,
    /// A `pub use` of a `mod.rs`: it hands on what lies behind the door.
    pub handed_on: bool,
}

/// A source file as `tidy` sees it.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its module, from the root of the crate.
    pub module: Vec<String>,
    /// What it names.
    pub named: Vec<Named>,
    /// Names that a `pub use` hands on, with where they come from.
    pub reexports: BTreeMap<String, Vec<String>>,
    /// String literals with their lines; those of attributes and documentation are left out.
    pub strings: Vec<(String, usize)>,
}

/// Reads a file of the crate; `name` is its path below `src/`.
pub fn read(name: &str, text: &str) -> syn::Result<Source> {
    let file = syn::parse_file(text)?;
    let module = module_of(name);
    let children = file
        .items
        .iter()
        .filter_map(|item| match item {
            syn::Item::Mod(m) => Some(m.ident.to_string()),
            _ => None,
        })
        .collect();
    let mut reader = Reader {
        modules: vec![module.clone()],
        children,
        aliases: BTreeMap::new(),
        named: Vec::new(),
        reexports: BTreeMap::new(),
        strings: Vec::new(),
        is_door: name.ends_with("mod.rs"),
    };
    // Names that `use` lines bring in stand for their paths everywhere in the file.
    reader.visit_file(&file);
    let Reader { named, reexports, strings, .. } = reader;
    Ok(Source { module, named, reexports, strings })
}

/// `render/view/hits.rs` is the module `render::view::hits`, `render/view/mod.rs` its parent.
pub fn module_of(name: &str) -> Vec<String> {
    let mut parts: Vec<String> =
        name.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if matches!(parts.last().map(String::as_str), Some("mod" | "lib")) {
        parts.pop();
    }
    parts
}

struct Reader {
    /// The module at hand, innermost last.
    modules: Vec<Vec<String>>,
    /// Modules that the file declares.
    children: BTreeSet<String>,
    /// What a name of a `use` line stands for.
    aliases: BTreeMap<String, Vec<String>>,
    named: Vec<Named>,
    reexports: BTreeMap<String, Vec<String>>,
    strings: Vec<(String, usize)>,
    is_door: bool,
}

impl Reader {
    fn here(&self) -> &[String] {
        self.modules.last().map_or(&[], Vec::as_slice)
    }

    /// From the root of the crate, if the path is one of ours.
    fn resolve(&self, path: &[String]) -> Option<Vec<String>> {
        let first = path.first()?.as_str();
        let rest = || path[1..].iter().cloned();
        match first {
            "crate" => Some(rest().collect()),
            "self" => Some(self.here().iter().cloned().chain(rest()).collect()),
            "super" => {
                let ups = path.iter().take_while(|p| *p == "super").count();
                let here = self.here();
                let base = &here[..here.len().saturating_sub(ups)];
                Some(base.iter().chain(&path[ups..]).cloned().collect())
            }
            name if self.children.contains(name) => {
                Some(self.modules[0].iter().chain(path).cloned().collect())
            }
            _ => None,
        }
    }

    fn note(&mut self, path: &[String], line: usize, handed_on: bool) {
        if let Some(path) = self.resolve(path) {
            self.named.push(Named { path, ours: true, line, handed_on });
        } else if let Some(alias) = path.first().and_then(|f| self.aliases.get(f)).cloned() {
            let path = alias.into_iter().chain(path[1..].iter().cloned()).collect();
            self.named.push(Named { path, ours: true, line, handed_on });
        } else {
            self.named.push(Named { path: path.to_vec(), ours: false, line, handed_on });
        }
    }

    fn leaves(&mut self, tree: &syn::UseTree, before: &[String], public: bool) {
        let with = |name: &syn::Ident| {
            before.iter().cloned().chain([name.to_string()]).collect::<Vec<_>>()
        };
        match tree {
            syn::UseTree::Path(p) => self.leaves(&p.tree, &with(&p.ident), public),
            syn::UseTree::Group(g) => {
                for item in &g.items {
                    self.leaves(item, before, public);
                }
            }
            syn::UseTree::Name(n) if n.ident == "self" => {
                let name = before.last().cloned().unwrap_or_default();
                self.leaf(&name, before, n.ident.span().start().line, public);
            }
            syn::UseTree::Name(n) => {
                let line = n.ident.span().start().line;
                self.leaf(&n.ident.to_string(), &with(&n.ident), line, public);
            }
            syn::UseTree::Rename(r) => {
                let line = r.ident.span().start().line;
                self.leaf(&r.rename.to_string(), &with(&r.ident), line, public);
            }
            syn::UseTree::Glob(g) => {
                let line = g.span().start().line;
                self.note(before, line, public && self.is_door);
            }
        }
    }

    fn leaf(&mut self, name: &str, path: &[String], line: usize, public: bool) {
        if let Some(ours) = self.resolve(path) {
            if public {
                self.reexports.insert(name.to_owned(), ours.clone());
            }
            if self.modules.len() == 1 {
                self.aliases.insert(name.to_owned(), ours);
            }
        }
        self.note(path, line, public && self.is_door);
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        if !attributes(item).iter().any(is_for_tests) {
            syn::visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let public = !matches!(item.vis, syn::Visibility::Inherited);
        self.leaves(&item.tree, &[], public);
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if item.content.is_some() {
            let inner =
                self.here().iter().cloned().chain([item.ident.to_string()]).collect::<Vec<_>>();
            self.modules.push(inner);
            syn::visit::visit_item_mod(self, item);
            self.modules.pop();
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.segments.len() > 1 {
            let names: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
            self.note(&names, path.span().start().line, false);
        }
        syn::visit::visit_path(self, path);
    }

    fn visit_attribute(&mut self, attribute: &'ast syn::Attribute) {
        let before = self.strings.len();
        syn::visit::visit_attribute(self, attribute);
        self.strings.truncate(before);
    }

    fn visit_lit_str(&mut self, literal: &'ast syn::LitStr) {
        self.strings.push((literal.value(), literal.span().start().line));
    }

    fn visit_macro(&mut self, mac: &'ast syn::Macro) {
        self.visit_path(&mac.path);
        // `format!`, `vec!`, `matches!` and the like take expressions; others are left alone.
        let arguments =
            mac.parse_body_with(Punctuated::<syn::Expr, syn::Token![,]>::parse_terminated);
        for argument in arguments.iter().flatten() {
            // The arguments live as long as this call; the visitor borrows nothing from them.
            Reader::visit_expr(self, argument);
        }
    }
}

fn is_for_tests(attribute: &syn::Attribute) -> bool {
    attribute.path().is_ident("test")
        || (attribute.path().is_ident("cfg")
            && matches!(&attribute.meta, syn::Meta::List(l) if l.tokens.to_string() == "test"))
}

fn attributes(item: &syn::Item) -> &[syn::Attribute] {
    match item {
        syn::Item::Const(i) => &i.attrs,
        syn::Item::Enum(i) => &i.attrs,
        syn::Item::Fn(i) => &i.attrs,
        syn::Item::Impl(i) => &i.attrs,
        syn::Item::Macro(i) => &i.attrs,
        syn::Item::Mod(i) => &i.attrs,
        syn::Item::Static(i) => &i.attrs,
        syn::Item::Struct(i) => &i.attrs,
        syn::Item::Trait(i) => &i.attrs,
        syn::Item::Type(i) => &i.attrs,
        syn::Item::Use(i) => &i.attrs,
        _ => &[],
    }
}
