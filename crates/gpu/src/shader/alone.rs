//! A module as WGSL for programs that write their own shaders.

use wesl::syntax::{
    Attribute, Declaration, DeclarationKind, Expression, GlobalDeclaration, LiteralExpression,
};

use super::mangle::unmangled;
use super::{Library, Linked, Permutation, Reflected};
use crate::GpuError;

/// Functions with all that they import, in one bind group.
#[derive(Clone, Debug)]
pub struct Alone {
    // All bindings in group 0.
    wgsl: String,
    /// What the group binds, by binding.
    pub bindings: Vec<Reflected>,
}

impl Alone {
    /// The text, to be put before or after a program's own, with its bindings in the group of that number. Names that it
    /// imports end in their module's, so that they meet none of the program's.
    pub fn wgsl(&self, group: u32) -> String {
        self.wgsl.replace("@group(0)", &format!("@group({group})"))
    }
}

impl Library {
    /// What an entry file and its imports declare, without its entry points, which are there to use what is wanted. All
    /// bindings come into one group, and pipeline-overridable constants become constants of these values.
    ///
    /// # Errors
    /// [`GpuError::Shader`] as [`Library::link`].
    pub fn alone(&self, permutation: &Permutation, constants: &[(&str, f64)]) -> Result<Alone, GpuError> {
        let mut unit = self.joined(permutation)?;
        let mut next = 0;
        for node in &mut unit.global_declarations {
            let GlobalDeclaration::Declaration(global) = node.node_mut() else { continue };
            if global.kind == DeclarationKind::Override {
                fix(global, constants);
            }
            if global.attributes.iter().any(|attribute| matches!(attribute.node(), Attribute::Group(_))) {
                let number = |n| Expression::Literal(LiteralExpression::AbstractInt(n));
                global.attributes = vec![
                    Attribute::Group(number(0).into()).into(),
                    Attribute::Binding(number(next).into()).into(),
                ];
                next += 1;
            }
        }
        let linked = Linked::validate(permutation.label(), unit.to_string(), |_| None)?;
        unit.global_declarations.retain(|node| match node.node() {
            GlobalDeclaration::Function(function) => !function.attributes.iter().any(|attribute| {
                matches!(attribute.node(), Attribute::Vertex | Attribute::Fragment | Attribute::Compute)
            }),
            _ => true,
        });
        Ok(Alone { wgsl: unit.to_string(), bindings: linked.bindings()? })
    }
}

/// Makes an overridable constant one of a given value, or of its own.
fn fix(global: &mut Declaration, constants: &[(&str, f64)]) {
    global.kind = DeclarationKind::Const;
    global.attributes.clear();
    let name = unmangled(&global.ident.name()).to_owned();
    let Some((_, value)) = constants.iter().find(|(known, _)| *known == name) else { return };
    let ty = global.ty.as_ref().map(ToString::to_string);
    let literal = match ty.as_deref() {
        Some("bool") => LiteralExpression::Bool(*value != 0.0),
        Some("u32") => LiteralExpression::U32(*value as u32),
        Some("i32") => LiteralExpression::I32(*value as i32),
        _ => LiteralExpression::F32(*value as f32),
    };
    global.initializer = Some(Expression::Literal(literal).into());
}
