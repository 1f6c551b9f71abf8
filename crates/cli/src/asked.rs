//! The scene, the camera and the settings that flags ask for.

use chiaro::scene::{HeightMap, Source};
use chiaro::{Lookout, Settings, scene};
use chiaro_lab::{SceneChoice, Session, Tracing, apply_preset};

use crate::args::{LookArgs, SceneArgs, SettingsArgs};

/// Tells the user a sentence.
pub fn tell(sentence: &str) {
    eprintln!("{sentence}");
}

/// What is seen, and from where.
pub fn choice(args: &SceneArgs) -> SceneChoice {
    SceneChoice { scene_in_file: args.scene_in_file.clone(), ..choice_of(source(args), &args.look) }
}

/// A scene seen as flags say.
pub fn choice_of(source: Source, look: &LookArgs) -> SceneChoice {
    let size = look.size.unwrap_or_default();
    SceneChoice {
        source,
        scene_in_file: None,
        strict: look.strict,
        environment: look.environment.clone(),
        camera: look.camera.clone(),
        view: own_view(look),
        size: [size.width, size.height],
    }
}

/// Opens the device, reads the scene, compiles the passes.
pub fn open(scene: &SceneArgs, settings: Settings) -> anyhow::Result<Session> {
    Ok(Session::open(&choice(scene), settings, &mut tell)?)
}

/// Opens the device and reads the scene for rays alone.
pub fn open_to_trace(scene: &SceneArgs, settings: Settings) -> anyhow::Result<Session<Tracing>> {
    Ok(Session::open_to_trace(&choice(scene), settings, &mut tell)?)
}

/// Tells what the renderer gave up, once.
pub fn tell_notes(session: &Session) {
    for note in session.notes() {
        eprintln!("warning: {note}");
    }
}

/// The scene that is asked for, or the default.
pub fn source(args: &SceneArgs) -> Source {
    if let Some(model) = &args.caster {
        return Source::Caster(model.clone());
    }
    let Some(image) = &args.terrain.height_map else {
        let name = args.scene.clone();
        return name.unwrap_or_else(|| format!("builtin:{}", scene::builtin::DEFAULT)).into();
    };
    Source::HeightMap(HeightMap {
        image: image.clone(),
        size_m: args.terrain.size_m.map(|size| size.0),
        height_m: args.terrain.height_m,
        vertices: args.terrain.vertices,
    })
}

/// A camera of the user's own.
pub fn own_view(look: &LookArgs) -> Option<Lookout> {
    let view = look.view.as_ref()?;
    Some(Lookout { eye_m: view.eye_m.into(), target_m: view.target_m.into(), yfov_rad: view.yfov_rad })
}

/// Preset, changes and pipeline, in this order.
pub fn settings(args: &SettingsArgs) -> anyhow::Result<Settings> {
    let mut settings = Settings { seed: args.seed, ..Settings::default() };
    if let Some(preset) = &args.preset {
        apply_preset(&mut settings, preset)?;
    }
    for change in &args.set {
        settings.set(&change.key, &change.value)?;
    }
    if let Some(pipeline) = &args.pipeline {
        settings.set("pipeline", pipeline)?;
    }
    Ok(settings)
}

/// Tells which of the changes asked for do nothing beside the others.
pub fn warn_of_idle(args: &SettingsArgs) -> anyhow::Result<()> {
    let settings = settings(args)?;
    let keys: std::collections::BTreeSet<_> = args.set.iter().map(|change| &change.key).collect();
    for key in keys {
        if let Some(only) = settings.idle(key) {
            eprintln!("warning: --set {key} does nothing here, {only}");
        }
    }
    Ok(())
}
