
module MODULE_host
  use MODULE
  implicit none
  private
  public :: reference_position, force, force_at_reference, traction_at, per_current_volume, is_static

  ! Whether the host's body loads are per current volume instead of per reference volume.
  logical :: per_current_volume = .false.
  ! Whether the host solves a static problem, with the time as a load factor.
  logical :: is_static = .false.

  PREPARED
  ! The X of the body with x = X + u(X, t): by Newton's method from x itself; where that leads nowhere, or out of the
  ! body, where the formulas may reach the same x again, from the place of a lattice that is carried next to x.
  function reference_position(x_now, t) result(X)
    real(dp), intent(in) :: x_now(DIMENSION), t
    real(dp) :: X(DIMENSION), place(DIMENSION), low(DIMENSION), high(DIMENSION), nearest, distance
    integer, parameter :: intervals = merge(24, 12, DIMENSION < 3)
    integer :: k, axis, rest
    logical :: found
    call make_ready()
    X = x_now
    call solve_motion(x_now, t, X, found)
    if (found) return
    call corners(low, high)
    nearest = huge(nearest)
    X = x_now
    do k = 0, (intervals + 1)**DIMENSION - 1
      rest = k
      do axis = 1, DIMENSION
        place(axis) = low(axis) + mod(rest, intervals + 1) * (high(axis) - low(axis)) / intervals
        rest = rest / (intervals + 1)
      end do
      if (.not. is_inside(place)) cycle
      distance = norm2((place + u(s, place, t)) - x_now)
      if (distance < nearest) then
        nearest = distance
        X = place
      end if
    end do
    call solve_motion(x_now, t, X, found)
    if (.not. found) then
      write (*, *) "no place of the body is carried to x =", x_now, "at t =", t, "; is that the time of the motion?"
      error stop 2
    end if
  end function

  ! Newton's method for X; steps that bring no progress are halved.
  subroutine solve_motion(x_now, t, X, found)
    real(dp), intent(in) :: x_now(DIMENSION), t
    real(dp), intent(inout) :: X(DIMENSION)
    logical, intent(out) :: found
    real(dp) :: step(DIMENSION), miss(DIMENSION), next(DIMENSION), tolerance, share
    integer :: round, halving
    tolerance = 4.0_dp * epsilon(1.0_dp) * max(maxval(abs(x_now)), tiny(1.0_dp))
    miss = (X + u(s, X, t)) - x_now
    do round = 1, 50
      if (maxval(abs(miss)) <= tolerance) exit
      step = solved(F(s, X, t), miss)
      share = 1.0_dp
      do halving = 1, 30
        next = X - share * step
        if (sum(((next + u(s, next, t)) - x_now)**2) < sum(miss**2)) exit
        share = 0.5_dp * share
      end do
      ! Rounding is all that is left.
      if (halving > 30) exit
      X = next
      miss = (X + u(s, X, t)) - x_now
    end do
    found = maxval(abs(miss)) <= 100.0_dp * tolerance .and. is_inside(X)
  end subroutine

  ! The corners of a box around the body.
  subroutine corners(low, high)
    real(dp), intent(out) :: low(DIMENSION), high(DIMENSION)
    low = CORNER_LOW
    high = CORNER_HIGH
  end subroutine

  ! Whether X is in the body, or next to it: the host's positions are not exact.
  logical function is_inside(X)
    real(dp), intent(in) :: X(DIMENSION)
    real(dp) :: low(DIMENSION), high(DIMENSION), slack
    call corners(low, high)
    slack = 0.05_dp * maxval(high - low)
    is_inside = INSIDE
  end function

  ! Component i of the force per volume at the reference position X.
  real(dp) function force_at_reference(X, t, i)
    real(dp), intent(in) :: X(DIMENSION), t
    integer, intent(in) :: i
    real(dp) :: values(DIMENSION)
    call make_ready()
    if (is_static) then
      values = static_force(s, X, t)
    else
      values = rho0_b(s, X, t)
    end if
    if (per_current_volume) values = values / VOLUME
    force_at_reference = values(i)
  end function

  ! Component i of the force per volume at the current position.
  real(dp) function force(x_now, t, i)
    real(dp), intent(in) :: x_now(DIMENSION), t
    integer, intent(in) :: i
    force = force_at_reference(reference_position(x_now, t), t, i)
  end function

  ! The traction per reference area at the current position, on the surface whose name is a part of `surface`.
  function traction_at(surface, x_now, t) result(traction)
    character(*), intent(in) :: surface
    real(dp), intent(in) :: x_now(DIMENSION), t
    real(dp) :: traction(DIMENSION), X(DIMENSION)
    traction = 0.0_dp
    X = reference_position(x_now, t)
    TRACTIONS
  end function
end module MODULE_host

subroutine dload(f, kstep, kinc, time, noel, npt, layer, kspt, coords, jltyp, sname)
  use MODULE, only: dp
  use MODULE_host, only: force
  implicit none
  real(dp) :: f, time(2), coords(3)
  integer :: kstep, kinc, noel, npt, layer, kspt, jltyp
  character(80) :: sname
  ! BXNU, BYNU and BZNU have the types 1, 2 and 3.
  if (jltyp >= 1 .and. jltyp <= DIMENSION) f = force(coords(1:DIMENSION), time(2), jltyp)
end subroutine

subroutine vdload(nblock, ndim, steptime, totaltime, amplitude, curcoords, velocity, dircos, jltyp, sname, value)
  use MODULE, only: dp
  use MODULE_host, only: force
  implicit none
  integer :: nblock, ndim, jltyp, k
  real(dp) :: steptime, totaltime, amplitude(nblock), curcoords(nblock, ndim), velocity(nblock, ndim)
  real(dp) :: dircos(nblock, ndim, ndim), value(nblock)
  character(80) :: sname
  if (jltyp < 1 .or. jltyp > DIMENSION) return
  do k = 1, nblock
    value(k) = force(curcoords(k, 1:DIMENSION), totaltime, jltyp)
  end do
end subroutine

subroutine utracload(alpha, t_user, kstep, kinc, time, noel, npt, coords, dircos, jltyp, sname)
  use MODULE, only: dp
  use MODULE_host, only: traction_at
  implicit none
  real(dp) :: alpha, t_user(3), time(2), coords(3), dircos(3, 3)
  integer :: kstep, kinc, noel, npt, jltyp
  character(80) :: sname
  real(dp) :: traction(DIMENSION)
  traction = traction_at(sname, coords(1:DIMENSION), time(2))
  alpha = norm2(traction)
  t_user = 0.0_dp
  t_user(1) = 1.0_dp
  if (alpha > 0.0_dp) t_user(1:DIMENSION) = traction / alpha
end subroutine
