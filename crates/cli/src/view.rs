//! `chiaro view`

use std::path::Path;

use anyhow::bail;
use chiaro_viewer::{Options, StartCamera};

use crate::args::ViewArgs;
use crate::session::{own_view, scene_name, settings};

pub fn run(args: &ViewArgs) -> anyhow::Result<()> {
    let scene = scene_name(&args.scene);
    if !scene.starts_with("builtin:") && !Path::new(&scene).exists() {
        bail!("{scene}: there is no such file; `chiaro scenes` lists the built-in scenes");
    }
    let camera = match (own_view(&args.scene), &args.scene.camera) {
        (Some(view), _) => StartCamera::At(view),
        (None, Some(wanted)) => StartCamera::Named(wanted.clone()),
        (None, None) => StartCamera::First,
    };
    let size = [args.scene.size.width, args.scene.size.height];
    let environment = args.scene.environment.clone();
    Ok(chiaro_viewer::run(Options { scene, environment, settings: settings(&args.settings)?, camera, size })?)
}
