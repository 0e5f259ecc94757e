"""The only module that uses the rerun package: values of a scene become entities of a recording."""

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tessera_cli.errors import RunError
from tessera_cli.maps.occupancy_file import UNKNOWN_GRAY
from tessera_cli.viewing.scene import (
    CURVE_COLORS,
    HERE,
    IMAGE,
    WORLD,
    Camera,
    Floor,
    Lines,
    Look,
    Moment,
    Picture,
    Points,
    PointSeries,
    Poses,
    Series,
    Shown,
    Voxels,
)

CLOSE_TIMEOUT_S = 10.0
# Timelines; the viewer can follow either.
FRAME, TIME = "frame", "time"
# Of cells that were seen; the others are left out.
FLOOR_OPACITY = 200


class RerunSink:
    """A recording that is sent to a viewer, written to a file, or both."""

    def __init__(self, title: str, viewer_url: str | None, path: Path | None, look: Look) -> None:
        self._recording = rr.RecordingStream("tessera", recording_id=None, send_properties=False)
        sinks: list[Any] = []
        if viewer_url:
            sinks.append(rr.GrpcSink(viewer_url))
        if path:
            sinks.append(rr.FileSink(path))
        try:
            self._recording.set_sinks(*sinks, default_blueprint=_blueprint(look))
        except RuntimeError as error:
            raise RunError(f"the view can't be written: {error}") from error
        self._recording.send_recording_name(title)
        self._recording.log(WORLD, rr.ViewCoordinates.RDF, static=True)
        for curve, color in CURVE_COLORS.items():
            self._recording.log(curve, rr.SeriesLines(colors=color, names=curve.rpartition("/")[2]), static=True)

    def arrange(self, look: Look) -> None:
        """Anew, as at the start."""
        self._recording.send_blueprint(_blueprint(look))

    def show(self, shown: Shown) -> None:
        moment = getattr(shown, "moment", None)
        if isinstance(shown, Poses | Series | PointSeries):
            self._send_columns(shown)
        else:
            if moment is not None:
                self._set_time(moment)
            self._recording.log(shown.path, *_archetypes(shown), static=moment is None)

    def flush(self) -> None:
        """Waits until all is sent or written."""
        self._recording.flush()

    def close(self) -> None:
        """A file is complete only after this. A viewer that is gone is not waited for."""
        try:
            self._recording.flush(timeout_sec=CLOSE_TIMEOUT_S)
        except RuntimeError:
            pass
        self._recording.disconnect()

    def _set_time(self, moment: Moment) -> None:
        self._recording.set_time(FRAME, sequence=moment.frame)
        self._recording.set_time(TIME, duration=moment.seconds)

    def _send_columns(self, shown: Poses | Series | PointSeries) -> None:
        """All frames at once."""
        if not len(shown.frames):
            return
        times = [rr.TimeColumn(FRAME, sequence=shown.frames), rr.TimeColumn(TIME, duration=shown.seconds)]
        if isinstance(shown, Series):
            columns = rr.Scalars.columns(scalars=shown.values)
        elif isinstance(shown, Poses):
            columns = rr.Transform3D.columns(translation=shown.translations, quaternion=shown.quaternions_xyzw)
        else:
            look = rr.Points2D.from_fields(colors=[shown.color], radii=rr.Radius.ui_points(shown.width_px))
            self._recording.log(shown.path, look, static=True)
            points = rr.Points2D.columns(positions=np.concatenate(shown.positions))
            columns = points.partition([len(positions) for positions in shown.positions])
        self._recording.send_columns(shown.path, times, columns)


def _archetypes(shown: Shown) -> list[Any]:
    match shown:
        case Points():
            points = rr.Points3D if shown.positions.shape[1] == 3 else rr.Points2D
            return [points(shown.positions, colors=shown.colors, radii=rr.Radius.ui_points(shown.width_px))]
        case Lines():
            is_flat = len(shown.strips) > 0 and shown.strips[0].shape[1] == 2
            lines = rr.LineStrips2D if is_flat else rr.LineStrips3D
            width = rr.Radius.ui_points(shown.width_px / 2)
            return [lines(shown.strips, colors=[shown.color], radii=width)]
        case Camera():
            model = shown.model
            focal, center = (model.fx, model.fy), (model.cx, model.cy)
            pinhole = rr.Pinhole(
                focal_length=focal,
                principal_point=center,
                resolution=(model.width, model.height),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=shown.depth,
            )
            return [pinhole]
        case Picture():
            return [rr.EncodedImage(contents=shown.jpeg, media_type="image/jpeg")]
        case Voxels():
            halves = np.repeat(shown.sizes[:, None] / 2, 3, axis=1)
            fill = rr.components.FillMode.Solid
            return [rr.Boxes3D(centers=shown.centers, half_sizes=halves, colors=shown.colors, fill_mode=fill)]
        case Floor():
            return [_floor(shown)]
    raise TypeError(f"{type(shown).__name__} can't be shown alone")


def _floor(shown: Floor) -> Any:
    """A rectangle with the grid as its texture."""
    rows, columns = shown.image.shape
    across, along = columns * shown.right, rows * shown.down
    corner = shown.corner - (shown.right + shown.down) / 2
    alpha = np.where(shown.image == UNKNOWN_GRAY, 0, FLOOR_OPACITY).astype(np.uint8)
    texture = np.dstack([shown.image] * 3 + [alpha])
    return rr.Mesh3D(
        vertex_positions=[corner, corner + across, corner + across + along, corner + along],
        triangle_indices=[[0, 1, 2], [0, 2, 3]],
        vertex_texcoords=[[0, 0], [1, 0], [1, 1], [0, 1]],
        albedo_texture=texture,
    )


def _blueprint(look: Look) -> Any:
    if look.eye is None:
        eye = rrb.EyeControls3D(tracking_entity=HERE, eye_up=(0, -1, 0))
    else:
        eye = rrb.EyeControls3D(position=look.eye, look_target=look.target, eye_up=(0, -1, 0))
    world = rrb.Spatial3DView(origin=WORLD, name="map", eye_controls=eye, background=(18, 20, 24), line_grid=False)
    # Lost keypoints may lie outside of the image; it fills its place all the same.
    bounds = (
        rrb.VisualBounds2D(x_range=(0, look.image_size[0]), y_range=(0, look.image_size[1]))
        if look.image_size
        else None
    )
    image = rrb.Spatial2DView(origin=IMAGE, name="image: tracked, new, lost", visual_bounds=bounds)
    plots = [_plot(path, title) for path, title in look.plots]
    side = rrb.Vertical(image, *plots, row_shares=[2] + [1] * len(plots))
    return rrb.Blueprint(
        rrb.Horizontal(world, side, column_shares=[2, 1]),
        rrb.TimePanel(state="collapsed", timeline=FRAME),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
    )


def _plot(path: str, title: str) -> Any:
    """The curves of all frames."""
    everything = rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin=path,
        name=title,
        axis_x=rrb.archetypes.TimeAxis(view_range=everything),
        plot_legend=rrb.Corner2D.LeftTop,
    )
