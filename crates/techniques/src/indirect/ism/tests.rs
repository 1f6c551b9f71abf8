use super::*;
use crate::indirect::IsmResolution;

fn settings(ism_resolution: IsmResolution, levels: u32) -> IndirectSettings {
    IndirectSettings { ism_resolution, levels, ..IndirectSettings::default() }
}

#[test]
fn the_defaults_fit_the_guaranteed_binding_and_take_what_the_module_says() {
    let plan = IsmPlan::within(128 << 20, &IndirectSettings::default(), 1024).unwrap();
    assert_eq!((plan.tiles, plan.levels, plan.blocks()), (1024, 2, 4));
    assert_eq!(plan.bytes(), (64 + 20) << 20);
}

#[test]
fn what_a_binding_cannot_hold_is_several_atlases_of_the_same_size() {
    let plan = IsmPlan::within(128 << 20, &settings(IsmResolution::Side256, 0), 513).unwrap();
    assert_eq!(plan.tiles, 257);
    assert_eq!(plan.vpls.div_ceil(plan.tiles), 2);
    assert_eq!(plan.bytes(), 513 << 18);
}

#[test]
fn levels_are_no_more_than_there_are() {
    for (resolution, levels, blocks) in [
        (IsmResolution::Side32, 5, 1),
        (IsmResolution::Side64, 6, 1),
        (IsmResolution::Side128, 7, 4),
        (IsmResolution::Side256, 8, 16),
    ] {
        let plan = IsmPlan::within(128 << 20, &settings(resolution, 8), 1).unwrap();
        assert_eq!((plan.levels, plan.blocks()), (levels, blocks));
    }
}

#[test]
fn maps_larger_than_memory_are_refused_by_name() {
    let settings = settings(IsmResolution::Side256, 0);
    assert!(IsmPlan::within(128 << 20, &settings, 8192).is_ok());
    let message = IsmPlan::within(128 << 20, &settings, 8193).unwrap_err().to_string();
    assert!(message.contains("8193") && message.contains("256²") && message.contains("fewer"), "{message}");
    assert!(IsmPlan::within(1 << 10, &settings, 1).is_err());
    let many = IsmPlan::within(1 << 30, &self::settings(IsmResolution::Side32, 0), 65_536);
    assert!(many.unwrap_err().to_string().contains("allows 65535"));
}
