//! The viewer in a real window, on an X server of its own.
//!
//! The server's address is in the environment, which a process must not change while it runs; so the test that one sees
//! starts Xvfb, and starts this program again with that address and the one test that opens the window.

#![cfg(target_os = "linux")]

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use chiaro_testkit::ambient;
use chiaro_viewer::{Options, Shell, Wake};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{DeviceEvent, DeviceId, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::platform::x11::EventLoopBuilderExtX11;
use winit::window::WindowId;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ConnectionExt, ImageFormat};

const INNER_TEST: &str = "the_window_itself";
/// A busy machine without a graphics card; a window that has not opened by then never will.
const PATIENCE: Duration = Duration::from_mins(2);
const SCREEN: [u16; 2] = [900, 500];

/// Ends with the test, however that ends.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// An X server on a display that is free, and the display's number.
fn server() -> (Server, String) {
    let [width, height] = SCREEN;
    let child = Command::new("Xvfb")
        .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &format!("{width}x{height}x24")])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let mut child = child.unwrap_or_else(|e| {
        panic!("this test needs Xvfb, an X server without a screen ({e}); on Debian: apt-get install xvfb")
    });
    let mut number = String::new();
    let output = child.stdout.take().expect("it is piped");
    BufReader::new(output).read_line(&mut number).unwrap();
    let server = Server(child);
    assert!(!number.trim().is_empty(), "Xvfb found no free display");
    (server, number.trim().to_owned())
}

#[test]
fn a_window_opens_shows_scene_and_panel_and_survives_resizes() {
    let (_server, number) = server();
    let inner = Command::new(std::env::current_exe().unwrap())
        .args([INNER_TEST, "--exact", "--ignored", "--nocapture"])
        .env("DISPLAY", format!(":{number}"))
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap();
    let said = [inner.stdout, inner.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    assert!(inner.status.success() && said.contains("1 passed"), "{said}");
}

#[test]
#[ignore = "is started by the test above, on a display of its own"]
fn the_window_itself() {
    let event_loop = EventLoop::<Wake>::with_user_event().with_x11().with_any_thread(true).build().unwrap();
    let options = Options {
        scene: "builtin:cornell".into(),
        settings: ambient(),
        size: [520, 360],
        ..Options::default()
    };
    let shell = Shell::new(&event_loop, options);
    let mut driver = Driver { shell, start: Instant::now(), sizes: SIZES.to_vec(), seen: 0 };
    event_loop.run_app(&mut driver).unwrap();
    assert!(driver.shell.error.is_none(), "{:?}", driver.shell.error);
    assert_eq!(driver.seen, SIZES.len() + 1, "the window was closed early");
}

/// Sizes that the window takes one after the other; the last is that of the screenshot.
const SIZES: [[u32; 2]; 8] =
    [[300, 200], [16, 9], [600, 30], [1, 1], [640, 480], [333, 77], [77, 333], [800, 400]];

struct Driver {
    shell: Shell,
    start: Instant,
    sizes: Vec<[u32; 2]>,
    seen: usize,
}

impl Driver {
    fn step(&mut self, event_loop: &ActiveEventLoop) {
        assert!(self.start.elapsed() < PATIENCE, "the window did not get as far as it should");
        let is_shown = self.shell.viewer().is_some_and(|viewer| viewer.is_settled() && viewer.frames() >= 2);
        if !is_shown {
            return;
        }
        let Some(window) = self.shell.window() else { return };
        self.seen += 1;
        if self.seen <= self.sizes.len() {
            let [width, height] = self.sizes[self.seen - 1];
            let _ = window.request_inner_size(PhysicalSize::new(width, height));
        } else {
            check_screen();
            event_loop.exit();
        }
    }
}

/// What is on the screen: the scene on the left, the panel on the right.
fn check_screen() {
    let (connection, screen) = x11rb::connect(None).unwrap();
    let root = connection.setup().roots[screen].root;
    let [width, height] = SCREEN;
    let image = connection.get_image(ImageFormat::Z_PIXMAP, root, 0, 0, width, height, !0).unwrap();
    let image = image.reply().unwrap().data;
    let pixel = |x: usize, y: usize| {
        let at = 4 * (y * usize::from(width) + x);
        [image[at + 2], image[at + 1], image[at]].map(i32::from)
    };
    // Without a window manager the window stands in the corner. The box's left wall is red; the panel is grey.
    let is_red = |[red, green, _]: [i32; 3]| red > 60 + green;
    let reds = (0..200).filter(|y| (0..60).any(|x| is_red(pixel(x, 100 + y)))).count();
    assert!(reds > 50, "the scene is not on the screen: {reds} rows with red pixels");
    let is_panel = |[red, green, blue]: [i32; 3]| red == green && green == blue && (22..=26).contains(&red);
    let greys = (0..350).filter(|y| (500..790).filter(|x| is_panel(pixel(*x, *y))).count() > 100).count();
    assert!(greys > 200, "the panel is not on the screen: {greys} rows of it");
}

impl ApplicationHandler<Wake> for Driver {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        self.shell.resumed(event_loop);
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, wake: Wake) {
        self.shell.user_event(event_loop, wake);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, id: WindowId, event: WindowEvent) {
        let is_frame = event == WindowEvent::RedrawRequested;
        self.shell.window_event(event_loop, id, event);
        if is_frame {
            self.step(event_loop);
        }
    }

    fn device_event(&mut self, event_loop: &ActiveEventLoop, id: DeviceId, event: DeviceEvent) {
        self.shell.device_event(event_loop, id, event);
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        self.shell.about_to_wait(event_loop);
        assert!(self.start.elapsed() < PATIENCE, "the window waits for ever");
        if event_loop.control_flow() == ControlFlow::Wait {
            event_loop.set_control_flow(ControlFlow::WaitUntil(Instant::now() + Duration::from_secs(1)));
        }
    }
}
