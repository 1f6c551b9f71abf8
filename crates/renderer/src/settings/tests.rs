mod idle;

use chiaro_techniques::settings::Kind;

use super::*;

#[test]
fn every_listed_key_can_be_read_and_set_to_its_default() {
    let mut settings = Settings::default();
    for field in Settings::fields() {
        assert_eq!(settings.get(&field.key).as_ref(), Some(&field.default), "{}", field.key);
        settings.set(&field.key, &field.default).unwrap();
    }
    assert_eq!(settings, Settings::default());
}

#[test]
fn an_unknown_key_names_the_nearest() {
    let message = Settings::default().set("shadow.resolutoin", "1").unwrap_err().to_string();
    assert!(message.contains("shadow.resolution"), "{message}");
}

#[test]
fn the_thesis_shadows_have_no_highlights_back_faces_and_the_most_anisotropy() {
    let mut settings = Settings::default();
    settings.apply_preset("thesis-shadows", None).unwrap();
    let is = |key: &str, value: &str| assert_eq!(settings.get(key).as_deref(), Some(value), "{key}");
    is("surface.lighting", "lambert");
    is("shadow.bias.cull_front", "true");
    is("shadow.sigma", "1.79");
    for key in ["surface.anisotropy", "shadow.anisotropy"] {
        let field = Settings::fields().iter().find(|field| field.key == key).unwrap();
        let Kind::Whole(_, most) = field.kind else { panic!("{key}") };
        is(key, &most.to_string());
    }
}

#[test]
fn conditions_are_of_keys_and_values_that_there_are() {
    for field in Settings::fields() {
        for clause in field.only.iter().flat_map(|only| only.alternatives().flatten().collect::<Vec<_>>()) {
            for value in clause.values {
                let mut settings = Settings::default();
                settings.set(clause.key, value).unwrap();
                assert_eq!(settings.get(clause.key).as_deref(), Some(value), "{}", field.key);
            }
        }
    }
}

fn with(changes: &[(&str, &str)]) -> Settings {
    let mut settings = Settings::default();
    for (key, value) in changes {
        settings.set(key, value).unwrap();
    }
    settings
}

#[test]
fn a_key_that_does_nothing_says_what_would_have_to_change_first() {
    let why = |changes: &[(&str, &str)], key: &str| with(changes).idle(key).map(|only| only.to_string());
    assert_eq!(why(&[], "shadow.pcf_kernel"), None);
    assert_eq!(why(&[], "shadow.sigma").unwrap(), "only with shadow.filter=gaussian|gaussian-mip");
    // Of two filters neither; then a kernel that does nothing itself.
    assert!(why(&[], "shadow.filter_radius").unwrap().contains(" or shadow.pcf_kernel=disc"));
    let none = ("shadow.layout", "none");
    assert_eq!(why(&[none], "shadow.pcf_kernel").unwrap(), "only with shadow.layout=single|cascaded");
    assert_eq!(why(&[none], "shadow.sigma").unwrap(), "only with shadow.filter=gaussian|gaussian-mip");
    assert_eq!(why(&[none], "shadow.layout"), None);
    assert_eq!(why(&[], "surface.msaa").unwrap(), "only with pipeline=forward");
    assert_eq!(why(&[("pipeline", "forward")], "surface.msaa"), None);
}

#[test]
fn what_does_nothing_is_kept_for_when_it_does() {
    let settings = with(&[("surface.msaa", "8"), ("shadow.sigma", "3"), ("camera.show", "direct")]);
    let expected = with(&[("camera.show", "direct")]);
    assert_eq!(settings.effective(), expected);
    assert_eq!(settings.effective().effective(), expected);
    assert_eq!(settings.get("surface.msaa").as_deref(), Some("8"));
}

#[test]
fn a_preset_may_choose_the_pipeline() {
    let mut settings = Settings::default();
    settings.apply_preset("file", Some(r#"{ "pipeline": "forward", "surface.msaa": 1 }"#)).unwrap();
    assert_eq!((settings.pipeline, settings.surface.msaa.samples()), (Pipeline::Forward, 1));
    assert!(settings.set("pipeline", "back").unwrap_err().to_string().contains("deferred, forward"));
}

#[test]
fn presets_are_valid_and_files_take_keys_as_set_does() {
    for (name, _) in Settings::presets() {
        Settings::default().apply_preset(name, None).unwrap();
    }
    let mut settings = Settings::default();
    let file = r#"{ "shadow.resolution": 512, "shadow.filter": "none", "surface.normal_maps": false }"#;
    settings.apply_preset("file", Some(file)).unwrap();
    assert_eq!(settings.shadow.resolution, 512);
    assert!(!settings.surface.normal_maps);
    let wrong = settings.apply_preset("file", Some("{ \"shadow.resolution\": ")).unwrap_err().to_string();
    assert!(wrong.contains("line 1"), "{wrong}");
}

#[test]
fn left_to_the_adapter_maps_that_compute_has_no_room_for_are_rastered_by_the_hardware() {
    let mut settings = Settings::default();
    let choice = |settings: &Settings| settings.resolved_for(true, 128 << 20).shadow.raster;
    settings.shadow.resolution = 4096;
    assert_eq!(choice(&settings), Raster::Compute);
    settings.shadow.resolution = 8192;
    assert_eq!(choice(&settings), Raster::Hardware);
    settings.shadow.raster = Raster::Compute;
    assert_eq!(choice(&settings), Raster::Compute);
}
