! J2 plasticity with isotropic Voce hardening as a UMAT: radial return in small strain.
! The caller has rotated STRESS by DROT. The only internal variable is a scalar, so nothing else turns.
! PROPS: E, nu, sigma_0, H, Q, delta. Yield stress: sigma_0 + H a + Q (1 - exp(-delta a)).
! STATEV(1): a, the equivalent plastic strain. NTENS is 6 or 4.
! DDSDDE: d stress / d DSTRAN (algorithmic), not the Jaumann rate of the Kirchhoff stress.
subroutine umat(stress, statev, ddsdde, sse, spd, scd, rpl, ddsddt, drplde, drpldt, stran, dstran, time, dtime, &
    temp, dtemp, predef, dpred, cmname, ndi, nshr, ntens, nstatv, props, nprops, coords, drot, pnewdt, celent, &
    dfgrd0, dfgrd1, noel, npt, layer, kspt, jstep, kinc)
  implicit none
  integer :: ndi, nshr, ntens, nstatv, nprops, noel, npt, layer, kspt, jstep(4), kinc
  double precision :: stress(ntens), statev(nstatv), ddsdde(ntens, ntens), sse, spd, scd, rpl, ddsddt(ntens)
  double precision :: drplde(ntens), drpldt, stran(ntens), dstran(ntens), time(2), dtime, temp, dtemp, predef(1)
  double precision :: dpred(1), props(nprops), coords(3), drot(3, 3), pnewdt, celent, dfgrd0(3, 3), dfgrd1(3, 3)
  character(len=80) :: cmname
  double precision :: bulk, shear, elastic(ntens, ntens), one(ntens), deviator(ntens), normal(ntens), pressure
  double precision :: mises, flow, hardening, a, step, theta, theta_bar
  integer :: i, iteration

  bulk = props(1) / (3 * (1 - 2 * props(2)))
  shear = props(1) / (2 * (1 + props(2)))
  one = 0
  one(1:ndi) = 1
  elastic = 0
  do i = 1, ntens
    elastic(i, i) = merge(2 * shear, shear, i <= ndi)
  end do
  elastic(1:ndi, 1:ndi) = elastic(1:ndi, 1:ndi) + bulk - 2 * shear / 3

  stress = stress + matmul(elastic, dstran)
  ddsdde = elastic
  pressure = sum(stress(1:ndi)) / 3
  deviator = stress - pressure * one
  mises = sqrt(1.5d0 * (sum(deviator(1:ndi)**2) + 2 * sum(deviator(ndi + 1:)**2)))
  a = statev(1)
  call yield(a, flow, hardening)
  if (mises <= flow) return

  ! Newton for the plastic multiplier: mises - 3 G step = flow(a + step).
  step = 0
  do iteration = 1, 50
    call yield(a + step, flow, hardening)
    flow = mises - 3 * shear * step - flow
    step = step + flow / (3 * shear + hardening)
    if (abs(flow) <= 1d-14 * mises) exit
  end do
  if (iteration > 50) then
    pnewdt = 0.5d0
    return
  end if
  statev(1) = a + step
  call yield(a + step, flow, hardening)

  ! Simo and Hughes, Computational Inelasticity, box 3.2, with n = deviator / |deviator|.
  normal = deviator * sqrt(1.5d0) / mises
  theta = 1 - 3 * shear * step / mises
  theta_bar = 1 / (1 + hardening / (3 * shear)) - (1 - theta)
  stress = theta * deviator + pressure * one
  ddsdde = 0
  do i = 1, ntens
    ddsdde(i, i) = merge(2 * shear, shear, i <= ndi) * theta
  end do
  ddsdde(1:ndi, 1:ndi) = ddsdde(1:ndi, 1:ndi) + bulk - 2 * shear * theta / 3
  do i = 1, ntens
    ddsdde(:, i) = ddsdde(:, i) - 2 * shear * theta_bar * normal * normal(i)
  end do

contains

  subroutine yield(a, flow, hardening)
    double precision, intent(in) :: a
    double precision, intent(out) :: flow, hardening
    flow = props(3) + props(4) * a + props(5) * (1 - exp(-props(6) * a))
    hardening = props(4) + props(5) * props(6) * exp(-props(6) * a)
  end subroutine yield
end subroutine umat
