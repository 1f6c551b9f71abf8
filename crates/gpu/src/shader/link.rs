//! Linking: an entry file and everything it imports become one WGSL text.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use wesl::syntax::{Attribute, Expression, GlobalDeclaration, LiteralExpression, TranslationUnit};
use wesl::{Feature, ModulePath, VirtualResolver, Wesl};

use super::compiled::Shader;
use super::mangle::{PathMangler, unmangled};
use super::reflect::Linked;
use crate::group::FIRST_OWN_GROUP;
use crate::{Gpu, GpuError};

/// An entry file with its `@if` flags. Every flag that its imports mention must be listed, on or off: an unknown
/// one is an error, not silently false.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Permutation {
    /// The entry file, such as `surface/resolve.cs.wesl`.
    pub entry: &'static str,
    /// Flags by name.
    pub flags: Vec<(&'static str, bool)>,
}

impl Permutation {
    /// An entry file without flags.
    pub fn plain(entry: &'static str) -> Self {
        Self { entry, flags: Vec::new() }
    }

    /// The same with one more flag.
    #[must_use]
    pub fn flag(mut self, name: &'static str, on: bool) -> Self {
        self.flags.push((name, on));
        self
    }

    /// The entry file and the flags that are on, for messages.
    pub fn label(&self) -> String {
        let on: Vec<_> = self.flags.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
        if on.is_empty() { self.entry.to_owned() } else { format!("{} [{}]", self.entry, on.join(", ")) }
    }
}

/// Shaders of devices; whoever wants one that is being made waits for it.
type Shaders = HashMap<(wgpu::Device, Permutation), Arc<Mutex<Option<Arc<Shader>>>>>;

/// WESL modules by file path. Clones share what was linked from them.
#[derive(Clone, Debug, Default)]
pub struct Library {
    files: Vec<(&'static str, Cow<'static, str>)>,
    shaders: Arc<Mutex<Shaders>>,
}

impl Library {
    /// Modules as (path below the crate's source folder, text).
    pub fn new(files: &[(&'static str, &'static str)]) -> Self {
        Self::default().with(files)
    }

    /// Adds another crate's modules, so that its shaders may import these.
    #[must_use]
    pub fn with(mut self, files: &[(&'static str, &'static str)]) -> Self {
        self.files.extend(files.iter().map(|&(path, text)| (path, Cow::Borrowed(text))));
        self.shaders = Arc::default();
        self
    }

    /// The same with other texts where `text` knows one for a path.
    #[must_use]
    pub fn replaced(mut self, text: impl Fn(&str) -> Option<String>) -> Self {
        for (path, known) in &mut self.files {
            if let Some(other) = text(path) {
                *known = Cow::Owned(other);
            }
        }
        self.shaders = Arc::default();
        self
    }

    /// Whether both have the same modules: what was compiled from one serves the other.
    pub fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shaders, &other.shaders)
    }

    /// Paths of all entry files: those whose name ends in `.cs.wesl` or `.rs.wesl`.
    pub fn entries(&self) -> impl Iterator<Item = &'static str> {
        self.files
            .iter()
            .map(|(path, _)| *path)
            .filter(|path| path.ends_with(".cs.wesl") || path.ends_with(".vs.wesl"))
    }

    /// Joins, mangles, validates.
    ///
    /// # Errors
    /// [`GpuError::Shader`] with the linker's or validator's message and place.
    pub fn link(&self, permutation: &Permutation) -> Result<Linked, GpuError> {
        let mut unit = self.joined(permutation)?;
        number_own_bindings(&mut unit);
        Linked::validate(permutation.label(), unit.to_string(), |line| self.place_of(line, permutation.entry))
    }

    /// An entry file with all that it imports and uses.
    pub(super) fn joined(&self, permutation: &Permutation) -> Result<TranslationUnit, GpuError> {
        let fail = |message: String| GpuError::Shader { name: permutation.label(), message };
        let mut resolver = VirtualResolver::new();
        for (path, text) in &self.files {
            resolver.add_module(module_path(path).map_err(&fail)?, Cow::Borrowed(text.as_ref()));
        }
        let mut wesl = Wesl::new_barebones().set_custom_resolver(resolver);
        wesl.use_imports(true).use_condcomp(true).use_stripping(true);
        wesl.set_custom_mangler(PathMangler);
        wesl.set_missing_feature_behavior(Feature::Error);
        for (name, on) in &permutation.flags {
            wesl.set_feature(name, *on);
        }
        let root = module_path(permutation.entry).map_err(&fail)?;
        let mut unit = wesl.compile(&root).map_err(|e| fail(e.to_string()))?.syntax;
        // The linker's own order follows from hashes that are others in every run; drivers know a shader that they have
        // compiled before by its text.
        unit.global_declarations.sort_by_cached_key(|declaration| name(declaration.node()));
        Ok(unit)
    }

    /// A permutation as the device takes it, linked once for all pipelines that are made of it.
    pub(crate) fn shader(&self, gpu: &Gpu, permutation: &Permutation) -> Result<Arc<Shader>, GpuError> {
        let key = (gpu.device.clone(), permutation.clone());
        let place = {
            let mut shaders = self.shaders.lock().unwrap_or_else(PoisonError::into_inner);
            shaders.entry(key).or_default().clone()
        };
        let mut known = place.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(shader) = &*known {
            return Ok(shader.clone());
        }
        let shader = Arc::new(Shader::new(gpu, &self.link(permutation)?)?);
        *known = Some(shader.clone());
        Ok(shader)
    }

    /// `path:line` of the line that became this one of the linked text; linking moves lines and renames what is imported,
    /// so they are compared without names' modules and spaces, the entry file's first.
    fn place_of(&self, linked: &str, entry: &str) -> Option<String> {
        let is_end = |c: char| !c.is_alphanumeric() && c != '_';
        let bare = |line: &str| -> String {
            let words = line.split_inclusive(is_end);
            words.fold(String::new(), |text, word| {
                let (name, end) = word.split_at(word.trim_end_matches(is_end).len());
                text + unmangled(name) + end.trim()
            })
        };
        let wanted = bare(linked);
        let find = |(path, text): &(&'static str, Cow<'static, str>)| {
            let index = text.lines().position(|line| bare(line) == wanted)?;
            Some(format!("{path}:{}", index + 1))
        };
        if !wanted.chars().any(char::is_alphanumeric) {
            return None;
        }
        let (own, others): (Vec<_>, Vec<_>) = self.files.iter().partition(|(path, _)| *path == entry);
        own.into_iter().chain(others).find_map(find)
    }
}

/// Gives the globals of a pass' own groups their numbers: modules say `@group(2) var …` and are told apart by name, so that
/// any of them goes with any other. Shared groups are declared once and keep theirs.
fn number_own_bindings(linked: &mut TranslationUnit) {
    let mut next = HashMap::new();
    for declaration in &mut linked.global_declarations {
        let GlobalDeclaration::Declaration(global) = declaration.node_mut() else { continue };
        let group = global.attributes.iter().find_map(|attribute| match attribute.node() {
            Attribute::Group(group) => literal(group),
            _ => None,
        });
        let Some(group) = group.filter(|group| *group >= i64::from(FIRST_OWN_GROUP)) else { continue };
        let number = next.entry(group).or_insert(0);
        let binding = Expression::Literal(LiteralExpression::AbstractInt(*number));
        global.attributes.push(Attribute::Binding(binding.into()).into());
        *number += 1;
    }
}

/// What a declaration is called; of what has no name, its text.
fn name(declaration: &GlobalDeclaration) -> String {
    match declaration {
        GlobalDeclaration::Declaration(it) => it.ident.to_string(),
        GlobalDeclaration::TypeAlias(it) => it.ident.to_string(),
        GlobalDeclaration::Struct(it) => it.ident.to_string(),
        GlobalDeclaration::Function(it) => it.ident.to_string(),
        GlobalDeclaration::Void | GlobalDeclaration::ConstAssert(_) => declaration.to_string(),
    }
}

fn literal(expression: &Expression) -> Option<i64> {
    match expression {
        Expression::Literal(LiteralExpression::AbstractInt(value)) => Some(*value),
        _ => None,
    }
}

/// `surface/resolve.cs.wesl` is the module `package::surface::resolve_cs`.
fn module_path(file: &str) -> Result<ModulePath, String> {
    let stem = file.strip_suffix(".wesl").ok_or_else(|| format!("{file} does not end in .wesl"))?;
    let path = format!("package::{}", stem.replace('.', "_").replace('/', "::"));
    path.parse().map_err(|e| format!("{path}: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_names_the_line_of_the_module_that_it_is_in() {
        let entry = "import package::b::thrice;\n\n@compute @workgroup_size(1)\nfn main() {\n    _ = thrice(2.0);\n}\n";
        let module = "// Three times.\nfn thrice(x: f32) -> f32 {\n    // A comment that linking drops.\n    return x * 3u;\n}\n";
        let permutation = Permutation::plain("a.cs.wesl");
        let library = Library::new(&[("a.cs.wesl", entry)]).with(&[("b.wesl", module)]);
        let error = library.link(&permutation).unwrap_err().to_string();
        assert!(error.contains("b.wesl:4: "), "{error}");
        let wrong = entry.replace("2.0", "two");
        let library = library.replaced(|path| (path == "a.cs.wesl").then(|| wrong.clone()));
        let error = library.link(&permutation).unwrap_err().to_string();
        assert!(error.contains("a.cs.wesl"), "{error}");
    }
}
