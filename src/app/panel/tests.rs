//! The panel, worked as somebody works it who can't see it: by the labels that it gives its knobs.

use super::*;
use crate::app::{assets, load};
use crate::scene::SurfaceKind;
use egui::accesskit::Role;
use egui_kittest::kittest::{NodeT, Queryable};
use egui_kittest::{Harness, Node};

/// A panel and what it is shown with.
struct Rig {
    state: PanelState,
    session: Session,
    history: History,
    push: PushCurve,
    asks: Vec<PanelAsk>,
}

impl Rig {
    fn new(sets: &[&str]) -> Self {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        let scene = load::scene("slab", &sets).expect("a bundled scene");
        let session = Session::new(scene, 1).expect("a sound scene");
        Self {
            state: PanelState::new("slab", &session),
            session,
            history: History::default(),
            push: PushCurve::default(),
            asks: Vec::new(),
        }
    }

    fn show(&mut self, ui: &mut Ui) {
        let shown = Shown {
            error: None,
            opening: None,
            section: None,
            history: &self.history,
            push: &self.push,
        };
        show(
            ui,
            &mut self.state,
            &mut self.session,
            shown,
            &mut self.asks,
        );
    }

    fn worked(self) -> Harness<'static, Self> {
        // So high that nothing is scrolled away.
        let size = egui::vec2(1200.0, 4000.0);
        let builder = Harness::builder().with_size(size);
        let mut harness = builder.build_ui_state(|ui, rig: &mut Self| rig.show(ui), self);
        harness.run_steps(3);
        harness
    }
}

/// A value of a slider that it does not have.
fn another_value(slider: &Node<'_>) -> f64 {
    let node = slider.accesskit_node();
    let low = node.min_numeric_value().expect("a slider has a range");
    let high = node.max_numeric_value().expect("a slider has a range");
    let now = node.numeric_value().expect("a slider has a value");
    // The farther end, which is another one for whole numbers too.
    if now - low < high - now { high } else { low }
}

fn open_lists(harness: &mut Harness<'_, Rig>) {
    for list in ["layers", "inner layers", "light 1", "light 2"] {
        if let Some(list) = harness.query_by_label(list) {
            list.click_accesskit();
        }
        harness.run_steps(30);
    }
}

#[test]
fn every_slider_changes_the_scene_or_the_hand_and_asks_for_what_that_needs() {
    for kind in [
        SurfaceKind::Plain,
        SurfaceKind::Subsurface,
        SurfaceKind::Gooey,
        SurfaceKind::Wrap,
        SurfaceKind::Absorption,
        SurfaceKind::Diffusion,
    ] {
        let kind_is = format!("surface.kind={}", kind.name());
        let mut harness = Rig::new(&[&kind_is]).worked();
        open_lists(&mut harness);
        let home = (
            harness.state().session.scene.clone(),
            harness.state().state.hand,
        );
        let count = harness.query_all_by_role(Role::Slider).count();
        assert!(count > 15, "{kind:?} has {count} sliders");
        for index in 0..count {
            harness.state_mut().asks.clear();
            let (label, value) = {
                let slider = harness.query_all_by_role(Role::Slider).nth(index);
                let slider = slider.expect("as many as before");
                let value = another_value(&slider);
                slider.set_value_accesskit(value);
                (slider.accesskit_node().label(), value)
            };
            harness.run_steps(2);
            let rig = harness.state();
            let (scene, hand) = (&rig.session.scene, rig.state.hand);
            assert!(
                (scene, hand) != (&home.0, home.1),
                "{kind:?}: slider {index} {label:?} set to {value} changes nothing"
            );
            assert_eq!(
                rig.asks.is_empty(),
                scene == &home.0,
                "{kind:?}: {label:?} asks for {:?}",
                rig.asks
            );
            // And all of it goes back, value by value.
            let mut back = scene.clone();
            while let Some(change) = changes::changes(&home.0, &back).first() {
                back = changes::undone(&back, change).expect("still a scene");
            }
            assert_eq!(back, home.0, "{label:?}");
            let rig = harness.state_mut();
            rig.session.scene = home.0.clone();
            rig.state.hand = home.1;
            harness.run_steps(1);
        }
    }
}

#[test]
fn a_panel_that_nobody_touches_changes_no_scene() {
    let mut harness = Rig::new(&[]).worked();
    let mut scenes: Vec<(String, Scene)> = (assets::scenes().iter())
        .map(|(name, _)| {
            let scene = load::scene(name, &[]).expect("a bundled scene");
            ((*name).to_owned(), scene)
        })
        .collect();
    // Sound values that lie beyond what the sliders reach.
    let mut far = load::scene("liver", &[]).expect("a bundled scene");
    far.solver.youngs_modulus_pa = 5e7;
    far.solver.substeps = 500;
    far.solver.timestep_s = 0.1;
    far.body.damping_per_s = 900.0;
    far.surface.layers[0].absorption_per_m = [0.0, 3e4, 1.0];
    far.surface.exposure = 50.0;
    far.surface.samples = 200;
    far.lights[0].irradiance_w_m2 = [5000.0, 0.0, 1.0];
    far.camera.fov_y_deg = 120.0;
    scenes.push(("one far out".to_owned(), far));
    for (name, scene) in scenes {
        let rig = harness.state_mut();
        rig.session.scene = scene.clone();
        rig.asks.clear();
        open_lists(&mut harness);
        harness.run_steps(2);
        let rig = harness.state();
        assert_eq!(changes::changes(&scene, &rig.session.scene), [], "{name}");
        assert_eq!(rig.asks, [], "{name}");
    }
}

#[test]
fn a_turned_value_is_listed_and_goes_back_by_its_button() {
    let mut harness = Rig::new(&[]).worked();
    let home = harness.state().session.scene.clone();
    let turned = &mut harness.state_mut().session.scene;
    turned.solver.substeps += 3;
    turned.surface.wetness = 0.123;
    harness.run_steps(2);
    harness
        .get_by_label("2 values were turned")
        .click_accesskit();
    harness.run_steps(3);
    assert!(harness.query_by_label("surface.wetness").is_some());
    let backs: Vec<_> = harness.query_all_by_label("back").collect();
    assert_eq!(backs.len(), 2);
    // In the order of their names: solver before surface.
    backs[1].click_accesskit();
    drop(backs);
    harness.run_steps(2);
    let rig = harness.state();
    assert_eq!(rig.session.scene.surface, home.surface);
    assert_ne!(rig.session.scene.solver, home.solver);
    assert_eq!(rig.asks, [PanelAsk::SurfaceKnobs]);
    harness.get_by_label("All back").click_accesskit();
    harness.run_steps(2);
    assert_eq!(harness.state().session.scene, home);
}

#[test]
fn an_error_is_shown_until_it_is_dismissed() {
    let mut harness = Rig::new(&[]).worked();
    harness.state_mut().state.error = Some("spleen.glb: no surface in it".to_owned());
    harness.run_steps(3);
    assert!(
        harness
            .query_by_label("spleen.glb: no surface in it")
            .is_some()
    );
    harness.get_by_label("Dismiss").click_accesskit();
    harness.run_steps(3);
    assert_eq!(harness.state().state.error, None);
    assert!(harness.query_by_label("Dismiss").is_none());
}

#[test]
fn buttons_ask_for_what_they_say() {
    let mut harness = Rig::new(&[]).worked();
    for (label, ask) in [
        ("Reset", PanelAsk::Reset),
        ("Script", PanelAsk::PlayScript),
        ("Camera", PanelAsk::ResetCamera),
        ("Record", PanelAsk::Record),
        ("Save scene", PanelAsk::SaveScene),
        ("top", PanelAsk::Look(Side::Top)),
    ] {
        harness.state_mut().asks.clear();
        harness
            .query_all_by_role(Role::Button)
            .find(|button| button.accesskit_node().label().as_deref() == Some(label))
            .unwrap_or_else(|| panic!("no button {label}"))
            .click_accesskit();
        harness.run_steps(2);
        assert_eq!(harness.state().asks, [ask], "{label}");
    }
    let rig = harness.state_mut();
    rig.asks.clear();
    rig.state.path = " my organ.glb ".to_owned();
    harness.get_by_label("Open").click_accesskit();
    harness.run_steps(2);
    let asks = &harness.state().asks;
    assert_eq!(asks, &[PanelAsk::Open("my organ.glb".to_owned())]);
    for (label, is_on) in [
        (
            "normals (V)",
            (|s: &PanelState| s.overlays.normals) as fn(&PanelState) -> bool,
        ),
        ("tetrahedra (B)", |s| s.overlays.lattice),
        ("layers cut open (X)", |s| s.overlays.section),
        ("error against cast rays (E)", |s| s.light_error_shown),
    ] {
        harness.get_by_label(label).click_accesskit();
        harness.run_steps(2);
        assert!(is_on(&harness.state().state), "{label}");
    }
}
