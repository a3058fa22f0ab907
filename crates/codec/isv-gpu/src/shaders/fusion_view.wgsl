// Some rows of a depth camera's image, and the planes that its pixels see (isv-fusion: view).

struct View {
    /// World to camera: what the axes of the world become.
    x_axis: vec3<f32>,
    /// Pixels a row.
    width: u32,
    y_axis: vec3<f32>,
    /// The first row that is here, and how many are.
    first_row: u32,
    z_axis: vec3<f32>,
    rows: u32,
    /// In pixels, along a row and along a column.
    focal: vec2<f32>,
    principal: vec2<f32>,
    /// Of the camera, in whole units, and the rest. The unit is a voxel or a block: whoever includes this says which.
    centre: vec3<i32>,
    /// Where its surfels begin.
    surfels: u32,
    rest: vec3<f32>,
}

/// The plane that the surface follows around a pixel, in camera coordinates with the voxel edge as unit.
struct Surfel {
    /// Unit normal, away from the camera.
    normal: vec3<f32>,
    /// Of the plane from the camera's centre.
    distance: f32,
    /// Largest distance from the plane at which the reading says how far the surface is.
    band: f32,
    /// What the reading counts in averages; 0 where there is none.
    weight: f32,
    /// The same where it may say that the space before its surface is free.
    free: f32,
}

/// A vector of the world in camera coordinates.
fn to_camera(view: View, v: vec3<f32>) -> vec3<f32> {
    return (view.x_axis * v.x) + (view.y_axis * v.y) + (view.z_axis * v.z);
}

/// A vector of the camera in world coordinates.
fn to_world(view: View, v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(view.x_axis, v), dot(view.y_axis, v), dot(view.z_axis, v));
}

/// The direction of a place of the image, with 1 along z.
fn ray_at(view: View, place: vec2<f32>) -> vec3<f32> {
    return vec3<f32>((place - view.principal) / view.focal, 1.0);
}

/// Column and row of a pixel of these rows.
fn place_of(view: View, pixel: u32) -> vec2<f32> {
    return vec2<f32>(f32(pixel % view.width), f32(view.first_row + (pixel / view.width)));
}

/// The point of a surfel's plane along a ray.
fn point_along(surfel: Surfel, ray: vec3<f32>) -> vec3<f32> {
    return ray * (surfel.distance / dot(surfel.normal, ray));
}

/// Cosine of the angle between a surfel's normal and a ray.
fn cosine_along(surfel: Surfel, ray: vec3<f32>) -> f32 {
    return dot(surfel.normal, ray) / length(ray);
}
