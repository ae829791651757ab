import time
from tests.vm.guest import video_link
def stream(serial, letters):
    from gellight.v4l2.video_camera import open_v4l2
    t=time.monotonic()
    with open_v4l2(f"v4l2://{video_link(serial)}?format={letters}&exposure_us=8000&gain=0&white_balance_k=4600") as c:
        t1=time.monotonic()
        fr=[c.read() for _ in range(30)]
        t2=time.monotonic()
        return dict(open=t1-t, per=(t2-t1)/30, seq=[f.sequence for f in fr], mean=float(fr[-1].image.mean()), st=c.status(), locked=c.controls.locked())
