//! `chiaro scenes`, `chiaro settings` and `chiaro info`: what there is to choose from.

use std::fmt::Write;

use chiaro::{Effect, Field, Gpu, Settings, scene};
use chiaro_lab::Machine;
use chiaro_lab::session::open_gpu;
use serde_json::json;

use crate::args::{ListArgs, ListSettingsArgs};
use crate::asked;
use crate::output::{print, print_json};

pub fn scenes(args: &ListArgs) -> anyhow::Result<()> {
    if args.json {
        let rows: Vec<_> = scene::builtin::SCENES
            .iter()
            .map(|(name, about)| json!({ "name": name, "about": about }))
            .collect();
        return print_json(&rows);
    }
    let mut text = String::new();
    for (name, about) in scene::builtin::SCENES {
        let default = if *name == scene::builtin::DEFAULT { " (default)" } else { "" };
        // Writing to a string does not fail, here and below.
        let _ = writeln!(text, "builtin:{name:<12} {about}{default}");
    }
    print(&text)
}

pub fn settings(args: &ListSettingsArgs) -> anyhow::Result<()> {
    let settings = asked::settings(&args.settings)?;
    let value = |field: &Field| settings.get(&field.key).unwrap_or_default();
    let cost = |effect| match effect {
        Effect::Uniform => "free to change",
        Effect::Resources => "a change reallocates",
        Effect::Permutation => "a change compiles a pipeline",
    };
    if args.json {
        let row = |f: &Field| {
            json!({
                "key": f.key, "unit": f.unit, "range": f.kind.to_string(), "default": f.default, "value": value(f),
                "meaning": f.meaning, "cost": cost(f.effect), "only_with": f.only.map(|only| only.0),
                "matters": settings.idle(&f.key).is_none(),
            })
        };
        return print_json(&Settings::fields().iter().map(row).collect::<Vec<_>>());
    }
    let mut text = String::new();
    for field in Settings::fields() {
        let (key, value) = (&field.key, value(field));
        let unit = if field.unit.is_empty() { String::new() } else { format!(" {}", field.unit) };
        let default =
            if value == field.default { String::new() } else { format!("default {}; ", field.default) };
        let _ = writeln!(text, "{key} = {value}{unit}   ({default}{}; {})", field.kind, cost(field.effect));
        let _ = writeln!(text, "    {}", field.meaning);
        let Some(only) = field.only else { continue };
        let _ = match settings.idle(key) {
            None => writeln!(text, "    Matters {only}."),
            Some(lacks) if lacks == only => writeln!(text, "    Does nothing here, {only}."),
            Some(lacks) => writeln!(text, "    Matters {only}. Does nothing here, {lacks}."),
        };
    }
    let _ = writeln!(
        text,
        "\nPresets (--preset NAME, or a .ron file such as {{ \"shadow.resolution\": 4096 }}):"
    );
    for (name, about) in Settings::presets() {
        let _ = writeln!(text, "    {name:<10} {about}");
    }
    print(&text)
}

pub fn run(args: &ListArgs) -> anyhow::Result<()> {
    let gpu = open_gpu(&mut asked::tell)?;
    let machine = Machine::of(&gpu);
    if args.json {
        let features: Vec<_> = gpu
            .feature_table()
            .map(|(name, purpose, has)| json!({ "name": name, "purpose": purpose, "used": has }))
            .collect();
        let (limits, pipelines) = (limits(&gpu), pipelines(&gpu));
        return print_json(
            &json!({ "machine": machine, "features": features, "limits": limits, "pipelines": pipelines }),
        );
    }
    let mut text = format!(
        "adapter  {} ({})\ndriver   {}\nbackend  {}\n\noptional features\n",
        machine.adapter, machine.kind, machine.driver, machine.backend
    );
    for (name, purpose, has) in gpu.feature_table() {
        let _ = writeln!(text, "  {} {name:<20} {purpose}", if has { "used   " } else { "missing" });
    }
    text += "\nlimits in use\n";
    for (name, value) in limits(&gpu) {
        let _ = writeln!(text, "  {name:<40} {value}");
    }
    let _ = writeln!(text, "\ncompiled pipelines\n  {}", pipelines(&gpu));
    text += "\nCHIARO_ADAPTER=NAME picks another adapter by a part of its name.\n";
    print(&text)
}

/// Who keeps compiled pipelines, as far as can be known.
fn pipelines(gpu: &Gpu) -> String {
    format!(
        "chiaro keeps none from run to run; the driver may, which it does not tell. A cache of one's own is {} by the \
         adapter (PIPELINE_CACHE) and not used",
        if gpu.offers_pipeline_cache { "offered" } else { "not offered" }
    )
}

fn limits(gpu: &Gpu) -> std::collections::BTreeMap<&'static str, u64> {
    let l = &gpu.limits;
    [
        ("max_texture_dimension_2d", u64::from(l.max_texture_dimension_2d)),
        ("max_texture_array_layers", u64::from(l.max_texture_array_layers)),
        ("max_buffer_size", l.max_buffer_size),
        ("max_storage_buffer_binding_size", l.max_storage_buffer_binding_size),
        ("max_storage_buffers_per_shader_stage", u64::from(l.max_storage_buffers_per_shader_stage)),
        ("max_compute_workgroup_storage_size", u64::from(l.max_compute_workgroup_storage_size)),
    ]
    .into()
}
