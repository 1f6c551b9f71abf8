//! Rust structs against their WESL twins, by name, offset and size.

use super::mangle::unmangled;
use super::reflect::Linked;

/// Members of a WGSL struct as (name, byte offset), and its size in bytes.
pub fn struct_layout(linked: &Linked, name: &str) -> Option<(Vec<(String, usize)>, usize)> {
    linked.module.types.iter().find_map(|(_, ty)| match (&ty.name, &ty.inner) {
        (Some(found), naga::TypeInner::Struct { members, span }) if unmangled(found) == name => {
            let members = members
                .iter()
                .map(|member| (member.name.clone().unwrap_or_default(), member.offset as usize))
                .collect();
            Some((members, *span as usize))
        }
        _ => None,
    })
}

/// Compares a Rust struct with the WGSL struct `name`.
///
/// # Errors
/// A sentence with both layouts when they differ, or when there is no such struct.
pub fn check_layout(linked: &Linked, name: &str, rust: &[(&str, usize)], size: usize) -> Result<(), String> {
    let (members, span) =
        struct_layout(linked, name).ok_or_else(|| format!("{} has no struct {name}", linked.label))?;
    // Rust spells out the padding that WGSL leaves unsaid.
    let rust: Vec<_> = rust.iter().filter(|(field, _)| !field.starts_with('_')).collect();
    let same = members.len() == rust.len()
        && members.iter().zip(&rust).all(|((a, at), (b, bt))| a == b && at == bt)
        && span == size;
    if same {
        Ok(())
    } else {
        Err(format!("{name}: WGSL {members:?}, {span} bytes; Rust {rust:?}, {size} bytes"))
    }
}
