
module MODULE_host
  use MODULE
  implicit none
  private
  public :: force, is_static

  ! Whether the step is static.
  logical :: is_static = .false.

  PREPARED
  ! The force per reference volume.
  function force(X, t) result(values)
    real(dp), intent(in) :: X(DIMENSION), t
    real(dp) :: values(DIMENSION)
    call make_ready()
    if (is_static) then
      values = static_force(s, X, t)
    else
      values = rho0_b(s, X, t)
    end if
  end function
end module MODULE_host

subroutine dload(f, kstep, kinc, time, noel, npt, layer, kspt, coords, jltyp, loadtype, vold, co, lakonl, konl, &
    ipompc, nodempc, coefmpc, nmpc, ikmpc, ilmpc, iscale, veold, rho, amat, mi)
  use MODULE, only: dp
  use MODULE_host, only: force
  implicit none
  real(dp) :: f, time(2), coords(3), vold(*), co(3, *), coefmpc(*), veold(*), rho
  integer :: kstep, kinc, noel, npt, layer, kspt, jltyp, konl(*), ipompc(*), nodempc(*), nmpc, ikmpc(*), ilmpc(*)
  integer :: iscale, mi(*)
  character(20) :: loadtype
  character(8) :: lakonl
  character(80) :: amat
  real(dp) :: values(DIMENSION)
  ! BXNU, BYNU and BZNU have the types 1, 2 and 3.
  if (jltyp < 1 .or. jltyp > DIMENSION) return
  values = force(coords(1:DIMENSION), time(2))
  f = values(jltyp)
end subroutine
