"""What commands use beside the doors, imported when it is used: `clothsim COMMAND --help` loads none of it."""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from numba.core.event import Listener, install_listener
    from numpy import savez
    from numpy.linalg import norm
    from PIL.Image import fromarray as as_image
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    from clothsim.base.kernel_cache import cached_kernels
    from clothsim.base.record import RECORD_NAME, RUN_PICTURES, SUMMARY_NAME, read_summary, record_peak_memory, to_json
    from clothsim.garments.penetration import draw_penetrations, entries, read_penetration_report
    from clothsim.garments.pictures import DRESS_PICTURES, draw_dress, draw_fit, draw_outfit, draw_sewing
    from clothsim.garments.unpose import read_canonical, unposed, write_canonical
    from clothsim.garments.wrinkled import OWN_FILES, refuse_unfit, wrinkle
    from clothsim.study.drape_recovery import read_outlines, recover_drape
    from clothsim.study.evaluation import FOLDER
    from clothsim.study.fabric_test import draw_drape, fabric_tested
    from clothsim.study.farm.claims import worker_of
    from clothsim.study.farm.dask_work import LostWorkersError, work_with_dask
    from clothsim.study.farm.drape import pilot
    from clothsim.study.farm.pack import contact_page, contact_sheet, pack, packed_files
    from clothsim.study.farm.plan import open_farm, plan, refuse_other_plan, refuse_unbuildable
    from clothsim.study.farm.recipe import load_recipe, make_recipe
    from clothsim.study.farm.status import status, verdict_text, write_manifest
    from clothsim.study.farm.verification import REPLAN, verify
    from clothsim.study.farm.work import MACHINE, repair, work
    from clothsim.study.goal_report import NamedGoal, goal_lines
    from clothsim.study.learned_drapes import learn
    from clothsim.study.learned_motion import SETS, division, learn_motion
    from clothsim.study.points import with_preset
    from clothsim.study.report import answer_lines, settings_text
    from clothsim.study.result import UNFINISHED
    from clothsim.viewer.preview import preview, preview_motion
    from transfer.motion_regressor import RegressorTraining
    from transfer.signed_distance import body_surface

__getattr__, __dir__, __all__ = lazy_names(__name__)
