//! `chiaro view`

use std::path::{Path, PathBuf};

use anyhow::bail;
use chiaro_viewer::{Options, StartCamera};

use crate::args::ViewArgs;
use chiaro::scene::Source;

use crate::asked::{own_view, settings, source, warn_of_idle};

/// Where the shaders lie in a checkout of chiaro.
const SOURCES: &str = "crates/techniques/src";

pub fn run(args: &ViewArgs) -> anyhow::Result<()> {
    let scene = source(&args.scene);
    let file = match &scene {
        Source::Named(name) if name.starts_with("builtin:") => None,
        Source::Named(name) => Some(Path::new(name)),
        Source::HeightMap(map) => Some(map.image.as_path()),
        Source::Caster(model) => {
            Some(model.as_path()).filter(|model| !model.to_string_lossy().starts_with("builtin:"))
        }
    };
    if file.is_some_and(|file| !file.exists()) {
        bail!("{scene}: there is no such file; `chiaro scenes` lists the built-in scenes");
    }
    let camera = match (own_view(&args.scene.look), &args.scene.look.camera) {
        (Some(lookout), _) => StartCamera::From(lookout),
        (None, Some(wanted)) => StartCamera::Named(wanted.clone()),
        (None, None) => StartCamera::First,
    };
    let size = args.scene.look.size.unwrap_or_default();
    let size = [size.width, size.height];
    let environment = args.scene.look.environment.clone();
    let settings = settings(&args.settings)?;
    warn_of_idle(&args.settings)?;
    let shaders = match &args.shaders {
        Some(folder) if !folder.is_dir() => bail!("--shaders {}: there is no such folder", folder.display()),
        Some(folder) => Some(folder.clone()),
        None => Some(PathBuf::from(SOURCES)).filter(|folder| folder.is_dir()),
    };
    Ok(chiaro_viewer::run(Options {
        scene,
        environment,
        strict: args.scene.look.strict,
        settings,
        camera,
        size,
        shaders,
        ..Options::default()
    })?)
}
